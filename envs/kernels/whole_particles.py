"""Particles copied whole, for resampling: x, y, heading and speed side by side are 16 bytes, one load instead of four gathers.

Rows of components are what every other loop wants, so they are interleaved first and taken apart again four particles at a time,
in registers. LLVM does not find that transposition in a plain loop, hence the intrinsic; on any processor it is vector code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.core.cgutils import ir, unpack_tuple  # ``ir``: numba's own builder of LLVM code
from numba.extending import intrinsic

from tagtrack.envs.kernels.compiling import inner

i32 = np.int32
index = np.uintp  # unsigned: no test for an index from the end
WORD = ir.IntType(32)
FOUR_FLOATS = ir.VectorType(ir.FloatType(), 4)


@inner
def interleave(x, y, heading, speed, whole):
    """Write particle i to whole[4 i : 4 i + 4]."""
    for i in range(x.shape[0]):
        first = index(4) * index(i)
        whole[first] = x[i]
        whole[first + index(1)] = y[i]
        whole[first + index(2)] = heading[i]
        whole[first + index(3)] = speed[i]


@inner
def take_descendants(whole, parent, x, y, heading, speed):
    """Particle j becomes the interleaved one that is the largest of parent[0..j]: running maximum and copy in one pass.

    The maximum waits for the one before, and the copies fill that time.
    """
    count = x.shape[0]
    last = i32(0)
    for block in range(count // 4):
        j = 4 * block
        first = max(last, parent[j])
        second = max(first, parent[j + 1])
        third = max(second, parent[j + 2])
        last = max(third, parent[j + 3])
        copy_four(whole, (first, second, third, last), (x, y, heading, speed), j)  # type: ignore[call-arg]  # numba adds one
    for j in range(count // 4 * 4, count):
        last = max(last, parent[j])
        own = index(4) * index(last)
        x[j] = whole[own]
        y[j] = whole[own + index(1)]
        heading[j] = whole[own + index(2)]
        speed[j] = whole[own + index(3)]


@intrinsic
def copy_four(typing_context: Any, whole: Any, numbers: Any, rows: Any, j: Any) -> Any:
    """Elements j to j + 3 of four rows from four interleaved particles: as many loads, a transposition, as many stores.

    ``whole`` and the rows are contiguous float32; the particles' numbers int32, not negative; nothing is tested.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def vector_at(kind: Any, array: Any, element: Any) -> Any:
            data = context.make_array(kind)(context, builder, array).data
            return builder.bitcast(builder.gep(data, [element]), FOUR_FLOATS.as_pointer())

        def particle(number: Any) -> Any:
            first = builder.shl(builder.zext(number, ir.IntType(64)), ir.IntType(64)(2))
            return builder.load(vector_at(whole, arguments[0], first), align=4)

        particles = [particle(number) for number in unpack_tuple(builder, arguments[1])]
        targets = unpack_tuple(builder, arguments[2])
        for target, row in zip(targets, transpose(builder, particles), strict=True):
            builder.store(row, vector_at(rows.dtype, target, arguments[3]), align=4)
        return context.get_dummy_value()

    return types.void(whole, numbers, rows, j), generate


def transpose(builder: Any, particles: list[Any]) -> list[Any]:
    """Four vectors of four: pairs first, then pairs of pairs."""

    def shuffle(left: Any, right: Any, *order: int) -> Any:
        return builder.shuffle_vector(left, right, ir.Constant(ir.VectorType(WORD, 4), list(order)))

    a, b, c, d = particles
    low, low_next = shuffle(a, b, 0, 4, 1, 5), shuffle(c, d, 0, 4, 1, 5)
    high, high_next = shuffle(a, b, 2, 6, 3, 7), shuffle(c, d, 2, 6, 3, 7)
    return [
        shuffle(low, low_next, 0, 1, 4, 5), shuffle(low, low_next, 2, 3, 6, 7),
        shuffle(high, high_next, 0, 1, 4, 5), shuffle(high, high_next, 2, 3, 6, 7),
    ]  # fmt: skip
