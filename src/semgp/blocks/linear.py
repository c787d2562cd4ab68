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
    out[:, :] = 0
    for k in range(0, n, _PANEL):
        e = min(k + _PANEL, n)
        _factor(A, k, e)
        _invert(A, k, e, out)
        D = np.ascontiguousarray(out[k:e, k:e])
        if k > 0:
            left = np.dot(np.ascontiguousarray(A[k:e, :k]), np.ascontiguousarray(out[:k, :k]))
            out[k:e, :k] = -np.dot(D, left)
        if e < n:
            panel = np.dot(np.ascontiguousarray(A[e:, k:e]), D.T)
            A[e:, k:e] = panel
            A[e:, e:] -= np.dot(panel, panel.T)


@njit(cache=True, nogil=True)
def packed_size(n: int) -> int:
    """Return the numbers in a lower triangle of n rows."""
    return n * (n + 1) // 2


@njit(cache=True, nogil=True)
def pack(L: F32, flat: F32) -> None:
    """Write the lower triangle of L (n, n) row by row: half the memory, and fresh memory is slow."""
    at = 0
    for i in range(len(L)):
        flat[at : at + i + 1] = L[i, : i + 1]
        at += i + 1


@njit(cache=True, nogil=True)
def unpack(flat: F32, L: F32) -> None:
    """Fill L (n, n) from its lower triangle; zeros above the diagonal."""
    at = 0
    for i in range(len(L)):
        L[i, : i + 1] = flat[at : at + i + 1]
        L[i, i + 1 :] = 0
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
