"""Covariances of sums of stationary kernels in single precision, tile by tile: the block map's inner loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, F64, I64
from semgp.blocks.elementary import exp_minus
from semgp.errors import InputError
from semgp.gp.kernels import Kernel, Sum
from semgp.gp.stationary import Matern12, Matern32, Matern52, SquaredExponential, Stationary

_SCALE = {Matern12: 1.0, Matern32: 3.0, Matern52: 5.0, SquaredExponential: 0.5}
_KINDS = tuple(_SCALE)
_ONE, _THIRD = np.float32(1), np.float32(1 / 3)


class Mixture(NamedTuple):
    """A sum of Q stationary kernels in D dimensions, ready for compiled loops.

    kind (Q,): index into Matern 1/2, 3/2, 5/2 and squared exponential. weight (Q, D): what squared differences
    are multiplied by. variance (Q,): sf^2.
    """

    kind: I64
    weight: F32
    variance: F32


def mixture(kernel: Kernel, n_dims: int) -> Mixture:
    """Return the compiled form of a sum of stationary kernels.

    Raises
    ------
    InputError
        Another kernel than a sum of stationary ones, or one that does not fit the dimensions.
    """
    terms = stationary_terms(kernel)
    weight = np.zeros((len(terms), n_dims))
    for q, term in enumerate(terms):
        dims = list(range(n_dims)) if term.dims is None else list(term.dims)
        if max(dims) >= n_dims or len(term.ell) not in (1, len(dims)):
            raise InputError(f"the kernel's length scales {term.ell} do not fit inputs of {n_dims} dimensions.")
        weight[q, dims] = _SCALE[type(term)] / np.asarray(term.ell) ** 2
    kind = np.array([_KINDS.index(type(term)) for term in terms])
    variance = np.array([term.sf**2 for term in terms])
    return Mixture(kind, weight.astype(np.float32), variance.astype(np.float32))


def stationary_terms(kernel: Kernel) -> list[Stationary]:
    """Return the terms of a sum of stationary kernels, in the order of its parameters.

    Raises
    ------
    InputError
        Another kernel.
    """
    if isinstance(kernel, Sum):
        return stationary_terms(kernel.left) + stationary_terms(kernel.right)
    if isinstance(kernel, Stationary) and type(kernel) in _SCALE:
        return [kernel]
    raise InputError(f"blocks take sums of stationary kernels, not {type(kernel).__name__}.")


@njit(cache=True, nogil=True)
def covariance_tile(Z: F32, n: int, X: F32, m: int, kernel: Mixture, K: F32, work: F32) -> None:
    """Fill K (n, m) with the covariances between the first n columns of Z (D, .) and the first m of X (D, .).

    Fast arithmetic on purpose: sums are reassociated and the exponential is a polynomial, right to 2e-7.
    """
    for j in range(n):
        _covariance_row(Z, j, X, m, kernel, K[j], work)


@njit(cache=True, nogil=True)
def covariance_lower(Z: F32, n: int, kernel: Mixture, K: F32, work: F32) -> None:
    """Fill the lower triangle of K (n, n) with the covariances of the first n columns of Z (D, .).

    What lies above the diagonal is of no meaning.
    """
    for j in range(n):
        _covariance_row(Z, j, Z, min((j | 15) + 1, n), kernel, K[j], work)  # whole vectors


@njit(cache=True, nogil=True, fastmath=True)
def _covariance_row(Z: F32, j: int, X: F32, m: int, kernel: Mixture, row: F32, work: F32) -> None:
    kind, weight, variance = kernel
    for q in range(m):
        row[q] = 0
    for k in range(len(kind)):
        _scaled_squares(Z, j, X, m, weight[k], work)
        s = variance[k]
        if kind[k] == 0:
            for q in range(m):
                row[q] += s * exp_minus(np.sqrt(work[q]))
        elif kind[k] == 1:
            for q in range(m):
                t = np.sqrt(work[q])
                row[q] += s * (_ONE + t) * exp_minus(t)
        elif kind[k] == 2:
            for q in range(m):
                t = np.sqrt(work[q])
                row[q] += s * (_ONE + t + t * t * _THIRD) * exp_minus(t)
        else:
            for q in range(m):
                row[q] += s * exp_minus(work[q])


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _scaled_squares(Z: F32, j: int, X: F32, m: int, w: F32, out: F32) -> None:
    """Fill in sum_d w_d (x_qd - z_jd)^2; the three coordinates in one pass, features after them."""
    z0, z1, z2 = Z[0, j], Z[1, j], Z[2, j]
    w0, w1, w2 = w[0], w[1], w[2]
    x0, x1, x2 = X[0], X[1], X[2]
    for q in range(m):
        d0, d1, d2 = x0[q] - z0, x1[q] - z1, x2[q] - z2
        out[q] = w0 * d0 * d0 + w1 * d1 * d1 + w2 * d2 * d2
    for d in range(3, len(w)):
        z, x, wd = Z[d, j], X[d], w[d]
        for q in range(m):
            difference = x[q] - z
            out[q] += wd * difference * difference


@njit(cache=True, nogil=True, fastmath=True)
def derivative_tile(
    Z: F32, n: int, X: F32, m: int, kernel: Mixture, H: F32, sign: float, out: F64, work: F32
) -> None:
    """Add sign * sum_jq H_jq dk(z_j, x_q) / dlog ell_d and / dlog sf to `out` (Q, D + 1), for each term."""
    kind, weight, variance = kernel
    D = weight.shape[1]
    for j in range(n):
        h = H[j]
        for k in range(len(kind)):
            _scaled_squares(Z, j, X, m, weight[k], work)
            # value, and what multiplies w_d (x_d - z_d)^2 in the derivative, both without sf^2
            value = np.float32(0)
            if kind[k] == 0:
                for q in range(m):
                    t = np.sqrt(work[q])
                    e = h[q] * exp_minus(t)
                    value += e
                    work[q] = e / max(t, np.float32(1e-6))
            elif kind[k] == 1:
                for q in range(m):
                    t = np.sqrt(work[q])
                    e = h[q] * exp_minus(t)
                    value += e * (_ONE + t)
                    work[q] = e
            elif kind[k] == 2:
                for q in range(m):
                    t = np.sqrt(work[q])
                    e = h[q] * exp_minus(t)
                    value += e * (_ONE + t + t * t * _THIRD)
                    work[q] = e * (_ONE + t) * _THIRD
            else:
                for q in range(m):
                    e = h[q] * exp_minus(work[q])
                    value += e
                    work[q] = np.float32(2) * e
            s = sign * variance[k]
            out[k, D] += 2 * s * value
            for d in range(D):
                z, x, moment = Z[d, j], X[d], np.float32(0)
                for q in range(m):
                    difference = x[q] - z
                    moment += work[q] * difference * difference
                out[k, d] += s * weight[k, d] * moment
