"""Short float32 polynomials for the functions in the inner loops: branch-free, so that a loop around them becomes SIMD.

Coefficients are minimax fits (Remez); ``tests/envs/test_maths.py`` holds each error bound against numpy over the whole range.
numba's own ``log``, ``exp`` and ``sin`` call the C library once per particle and are eight times slower.
"""

from __future__ import annotations

import numpy as np

from tagtrack.envs.kernels.compiling import compiled

f32 = np.float32
i32 = np.int32


@compiled
def sin_of_turns(t):
    """sin(2*pi*t) for t in [-1/2, 1/2], absolute error below 2e-7. For the cosine give 1/4 - |t|."""
    t = max(min(t, f32(0.5) - t), f32(-0.5) - t)  # folded to [-1/4, 1/4]
    z = t * t
    p = f32(39.538868)
    p = p * z - f32(76.550108)
    p = p * z + f32(81.601021)
    p = p * z - f32(41.341655)
    p = p * z + f32(6.2831852)
    return t * p


@compiled
def fast_log(x):
    """Natural logarithm of a positive normal float32, error below 2e-7 of the larger of 1 and the result."""
    bits = f32(x).view(i32)
    # Take the mantissa in [sqrt(1/2), sqrt(2)), so that the polynomial's argument m is centred on zero.
    exponent = (bits - i32(0x3F3504F3)) >> i32(23)
    m = i32(bits - i32(exponent << i32(23))).view(f32) - f32(1.0)
    p = f32(-0.1037872)
    p = p * m + f32(0.16338147)
    p = p * m - f32(0.17212425)
    p = p * m + f32(0.19884235)
    p = p * m - f32(0.2497156)
    p = p * m + f32(0.33335608)
    p = p * m - f32(0.50000344)
    p = p * m + f32(0.99999992)
    return f32(exponent) * f32(0.69314718) + m * p


@compiled
def fast_exp(x):
    """exp(x) for x <= 80, relative error below 5e-6 (the argument's rounding); 1.2e-38 at most below -87.3."""
    y = max(x * f32(1.44269504), f32(-126.0))
    whole = np.floor(y + f32(0.5))
    f = y - whole
    p = f32(0.001341)
    p = p * f + f32(0.009676036)
    p = p * f + f32(0.05550297)
    p = p * f + f32(0.24022107)
    p = p * f + f32(0.69314723)
    p = p * f + f32(1.0000001)
    return p * i32((i32(whole) + i32(127)) << i32(23)).view(f32)


@compiled
def fast_asin(x):
    """asin(x) for x in [-1, 1], absolute error below 2e-6 rad."""
    a = min(abs(x), f32(1.0))
    p = f32(-0.0043371709)
    p = p * a + f32(0.019348267)
    p = p * a - f32(0.04495724)
    p = p * a + f32(0.087875652)
    p = p * a - f32(0.21451227)
    p = p * a + f32(1.5707952)
    magnitude = f32(1.5707964) - np.sqrt(f32(1.0) - a) * p
    return np.copysign(magnitude, x)


@compiled
def normal_survival(z):
    """Chance that a standard normal exceeds z, absolute error below 5e-7 (Abramowitz and Stegun 1964, 7.1.26)."""
    a = abs(z) * f32(0.70710678)
    t = f32(1.0) / (f32(1.0) + f32(0.3275911) * a)
    p = f32(0.53070271)
    p = p * t - f32(0.72657601)
    p = p * t + f32(0.71070687)
    p = p * t - f32(0.14224837)
    p = p * t + f32(0.12741479)
    tail = p * t * fast_exp(-a * a)
    return tail if z > f32(0.0) else f32(1.0) - tail
