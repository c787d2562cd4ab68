"""Exponential and logarithm in single precision, written so that loops over them become vector instructions."""

from __future__ import annotations

import numpy as np
from numba import njit

_LOG_2, _INVERSE_LOG_2, _ROOT_2 = np.float32(np.log(2)), np.float32(1 / np.log(2)), np.float32(np.sqrt(2))
_LOWEST, _TINY = np.float32(-126), np.float32(1.2e-38)
# 2^f = sum_k (f log 2)^k / k! for 0 <= f < 1
_E0, _E1, _E2, _E3, _E4, _E5, _E6, _E7, _E8 = (
    np.float32(np.log(2) ** k / np.prod(np.arange(1.0, k + 1))) for k in range(9)
)
# log m = 2 atanh(s) = 2 s sum_k s^(2 k) / (2 k + 1), s = (m - 1) / (m + 1)
_L0, _L1, _L2, _L3, _L4 = (np.float32(2 / (2 * k + 1)) for k in range(5))
_HALF, _ONE = np.float32(0.5), np.float32(1)


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def exp_minus(t: np.float32) -> np.float32:
    """exp(-t) for t >= 0, to 2e-7 absolute: a power of two from the exponent's bits, times a polynomial."""
    y = max(-t * _INVERSE_LOG_2, _LOWEST)
    n = np.floor(y)
    f = y - n
    p = _E7 + f * _E8
    p = _E6 + f * p
    p = _E5 + f * p
    p = _E4 + f * p
    p = _E3 + f * p
    p = _E2 + f * p
    p = _E1 + f * p
    p = _E0 + f * p
    power = np.int32((np.int32(n) + np.int32(127)) << np.int32(23)).view(np.float32)
    return np.float32(p * power)


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def log(x: np.float32) -> np.float32:
    """Natural logarithm of a normal number x > 0, to 2e-7 absolute or of its value; of 1.2e-38 below that."""
    bits = np.float32(max(x, _TINY)).view(np.int32)
    exponent = np.float32((bits >> np.int32(23)) - np.int32(127))
    m = np.int32((bits & np.int32(0x7FFFFF)) | np.int32(0x3F800000)).view(np.float32)
    high = m > _ROOT_2
    m = m * _HALF if high else m
    exponent = exponent + _ONE if high else exponent
    s = (m - _ONE) / (m + _ONE)
    z = s * s
    p = _L3 + z * _L4
    p = _L2 + z * p
    p = _L1 + z * p
    p = _L0 + z * p
    return np.float32(exponent * _LOG_2 + s * p)
