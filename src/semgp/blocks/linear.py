"""Small dense factors in single precision: the inverse Cholesky factor of a block."""

from __future__ import annotations

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32

_PANEL = 32  # rows that plain loops factor; everything else is matrix products


@njit(cache=True, nogil=True)
def inverse_factor(A: F32, out: F32) -> None:
    """Fill `out` (n, n) with the inverse of the Cholesky factor of A (n, n); zeros above the diagonal.

    Reads the lower triangle of A only, and overwrites it with the factor L. A must be positive definite, as its
    noise sees to. Panel by panel, with D = L_kk^-1: L_ik = A_ik D^T, A_ij -= L_ik L_jk^T below and to the right,
    and row k of L^-1 is D [-L_k0 ... L_k,k-1, I] [L^-1 of the rows above].
    """
    n = len(A)
    for i in range(n):
        for j in range(n):
            out[i, j] = 0
    for k in range(0, n, _PANEL):
        e = min(k + _PANEL, n)
        _factor(A, k, e)
        _invert(A, k, e, out)
        D = _copy(out, k, e, k, e)
        if k > 0:
            left = np.dot(D, np.dot(_copy(A, k, e, 0, k), _copy(out, 0, k, 0, k)))
            for i in range(e - k):
                for j in range(k):
                    out[k + i, j] = -left[i, j]
        if e < n:
            panel = np.dot(_copy(A, e, n, k, e), D.T)
            _update(A, k, e, panel, np.dot(panel, panel.T))


@njit(cache=True, nogil=True)
def _copy(A: F32, a: int, b: int, c: int, d: int) -> F32:
    """A[a:b, c:d] in one piece."""
    out = np.empty((b - a, d - c), np.float32)
    for i in range(b - a):
        for j in range(d - c):
            out[i, j] = A[a + i, c + j]
    return out


@njit(cache=True, nogil=True)
def _update(A: F32, k: int, e: int, panel: F32, product: F32) -> None:
    """Put the panel in its place below the diagonal, and take its product from the lower triangle that is left."""
    for i in range(len(panel)):
        row = A[e + i]
        for j in range(e - k):
            row[k + j] = panel[i, j]
        for j in range(i + 1):
            row[e + j] -= product[i, j]


@njit(cache=True, nogil=True)
def packed_size(n: int) -> int:
    """Return the numbers in a lower triangle of n rows."""
    return n * (n + 1) // 2


@njit(cache=True, nogil=True)
def pack(L: F32, flat: F32) -> None:
    """Write the lower triangle of L (n, n) row by row: half the memory, and fresh memory is slow."""
    at = 0
    for i in range(len(L)):
        for j in range(i + 1):
            flat[at + j] = L[i, j]
        at += i + 1


@njit(cache=True, nogil=True)
def unpack(flat: F32, L: F32) -> None:
    """Fill L (n, n) from its lower triangle; zeros above the diagonal."""
    at = 0
    for i in range(len(L)):
        for j in range(len(L)):
            L[i, j] = flat[at + j] if j <= i else np.float32(0)
        at += i + 1


@njit(cache=True, nogil=True, fastmath=True)
def _factor(A: F32, a: int, b: int) -> None:
    """Cholesky factor of A[a:b, a:b] in its place, row by row."""
    for i in range(a, b):
        row = A[i]
        for j in range(a, i):
            other, s = A[j], row[j]
            for k in range(a, j):
                s -= row[k] * other[k]
            row[j] = s / other[j]
        s = row[i]
        for k in range(a, i):
            s -= row[k] * row[k]
        row[i] = np.sqrt(s)


@njit(cache=True, nogil=True, fastmath=True)
def _invert(L: F32, a: int, b: int, out: F32) -> None:
    """Invert the triangle L[a:b, a:b] row by row into the same place of `out`."""
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
