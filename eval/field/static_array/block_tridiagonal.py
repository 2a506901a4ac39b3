"""Symmetric positive definite systems in which each of K states touches only its neighbours: linear in K, time and memory."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from tagtrack.eval.field.static_array.model import Floats


def solve(diagonal: Floats, above: Floats, right: Floats) -> Floats:
    """Solution (K, s) for blocks on the diagonal (K, s, s) and above it (K - 1, s, s), and a right side (K, s).

    Raises:
        numpy.linalg.LinAlgError: if the matrix is not positive definite.
    """
    count, size = right.shape
    bands = np.zeros((2 * size, count * size))
    for row in range(size):
        for column in range(size):
            if column >= row:
                bands[2 * size - 1 - (column - row), column::size] = diagonal[:, row, column]
            bands[size - 1 - (column - row), size + column :: size] = above[:, row, column]
    return solveh_banded(bands, right.ravel(), check_finite=False).reshape(count, size)


def diagonal_of_inverse(diagonal: Floats, above: Floats) -> Floats:
    """Blocks (K, s, s) on the diagonal of the inverse: one sweep forward eliminates the past, one backward brings the future."""
    count = len(diagonal)
    result = np.empty_like(diagonal)
    result[0] = np.linalg.inv(diagonal[0])
    for index in range(1, count):
        result[index] = np.linalg.inv(diagonal[index] - above[index - 1].T @ result[index - 1] @ above[index - 1])
    for index in range(count - 2, -1, -1):
        gain = result[index] @ above[index]
        result[index] += gain @ result[index + 1] @ gain.T
    return result
