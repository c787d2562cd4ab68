"""Small dense factors in single precision: the inverse Cholesky factor of a block."""

from __future__ import annotations

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32

_SPLIT = 48  # above this many rows, halves and matrix products are faster than plain loops


@njit(cache=True, nogil=True, fastmath=True)
def inverse_factor(A: F32, out: F32) -> None:
    """Fill `out` (n, n) with the inverse of the Cholesky factor of A (n, n); zeros above the diagonal.

    A must be positive definite: the nugget sees to it.
    """
    L = np.linalg.cholesky(A)
    n = len(L)
    out[:, :] = 0
    if n <= _SPLIT:
        _inverse(L, 0, n, out)
        return
    h = n // 2
    _inverse(L, 0, h, out)
    _inverse(L, h, n, out)
    upper, lower = np.ascontiguousarray(out[:h, :h]), np.ascontiguousarray(out[h:n, h:n])
    corner = np.ascontiguousarray(L[h:n, :h])
    out[h:n, :h] = -np.dot(np.dot(lower, corner), upper)


@njit(cache=True, nogil=True, fastmath=True)
def _inverse(L: F32, a: int, b: int, out: F32) -> None:
    """Invert the triangle L[a:b, a:b] row by row into `out`."""
    for i in range(a, b):
        row = out[i]
        for k in range(a, i):
            c, above = L[i, k], out[k]
            for j in range(a, k + 1):
                row[j] -= c * above[j]
        d = np.float32(1) / L[i, i]
        for j in range(a, i):
            row[j] *= d
        row[i] = d
