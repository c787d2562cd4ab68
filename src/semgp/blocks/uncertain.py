"""Covariances of positions that are not certain: the kernel's expectation over where the points may be.

With independent Gaussian errors of variances s_i^2 and s_j^2 along an axis, the expectation of a squared
exponential kernel is one with l^2 + s_i^2 + s_j^2 in place of l^2 along that axis, times the product over the axes
of l / sqrt(l^2 + s_i^2 + s_j^2) (Girard, Rasmussen, Quinonero Candela and Murray-Smith, 2003). The same rule
serves for Matern kernels, which are mixtures of squared exponentials, with variances times the factor that brings
it closest to the expectation in three dimensions: at worst .035 of sf^2 away for Matern 5/2, .06 for 3/2, .18 for
1/2, over errors up to 2.5 length scales. It is the kernel of Paciorek and Schervish (2004), which is positive
definite, each point scaled by a factor of its own.

The points of one scan are displaced together, each by its own standard deviation: along an axis, what two of them
are displaced against each other has the variance (s_i - s_j)^2 instead of s_i^2 + s_j^2. What a site says is the
mean over a set of draws, A, and another's over B: the first rule holds for the share w = |A and B| / (|A| |B|) of
the pairs, the second for the rest. Points to be predicted share no draw. All of this is the covariance of averages
of one random function, so that it stays positive definite.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, F64
from semgp.blocks.covariance import Mixture, covariance_lower, covariance_tile, derivative_tile
from semgp.blocks.elementary import exp_minus

_PER_WEIGHT = (
    1.6 / 1.0,
    1.25 / 3.0,
    1.15 / 5.0,
    1.0 / 0.5,
)  # that factor over weight times l^2, by kind of kernel
_ONE, _THIRD = np.float32(1), np.float32(1 / 3)


@njit(cache=True, nogil=True)
def cross_covariance(Z: F32, SZ: F32, n: int, X: F32, SX: F32, m: int, kernel: Mixture, K: F32, work: F32) -> None:
    """Fill K (n, m) with the covariances between the first columns of Z (D, .) and of X (D, .).

    SZ, SX (3, .) are the variances of their positions, (0, .) where they are certain.
    """
    if len(SZ) + len(SX) == 0:
        covariance_tile(Z, n, X, m, kernel, K, work)
        return
    gain, s = np.empty(m, np.float32), np.zeros(3, np.float32)
    for j in range(n):
        for d in range(len(SZ)):
            s[d] = SZ[d, j]
        _expected_row(Z, j, s, X, SX, m, False, kernel, K[j], work, gain)


@njit(cache=True, nogil=True)
def member_covariance(X: F32, S: F32, n: int, kernel: Mixture, K: F32, work: F32) -> None:
    """Fill the lower triangle of K (n, n) with the covariances of the first n columns of X (D, .).

    S (5, .) are the variances of their positions and their sets of draws, (0, .) where they are certain.
    """
    if len(S) == 0:
        covariance_lower(X, n, kernel, K, work)
        return
    gain, together = np.empty(n, np.float32), np.empty(n, np.float32)
    size = _set_sizes(S, n)
    for j in range(n):
        _expected_row(X, j, S[:, j], X, S, j + 1, False, kernel, K[j], work, gain)
        _expected_row(X, j, S[:, j], X, S, j + 1, True, kernel, together, work, gain)
        for q in range(j + 1):
            K[j, q] += _shared(S, size, j, q) * (together[q] - K[j, q])


@njit(cache=True, nogil=True)
def cross_derivative(
    Z: F32, SZ: F32, n: int, X: F32, SX: F32, m: int, kernel: Mixture, H: F32, sign: float, out: F64, work: F32
) -> None:
    """Add sign * sum_jq H_jq dk_jq / dlog ell_d and / dlog sf to `out` (Q, D + 1), for each term."""
    if len(SZ) + len(SX) == 0:
        derivative_tile(Z, n, X, m, kernel, H, sign, out, work)
        return
    s = np.zeros(3, np.float32)
    for j in range(n):
        for d in range(len(SZ)):
            s[d] = SZ[d, j]
        _expected_derivative(Z, j, s, X, SX, m, False, kernel, H[j], sign, out)


@njit(cache=True, nogil=True)
def member_derivative(X: F32, S: F32, n: int, kernel: Mixture, H: F32, sign: float, out: F64, work: F32) -> None:
    """Add the same for the covariances of the first n columns of X with each other."""
    if len(S) == 0:
        derivative_tile(X, n, X, n, kernel, H, sign, out, work)
        return
    size, apart, together = _set_sizes(S, n), np.empty(n, np.float32), np.empty(n, np.float32)
    for j in range(n):
        for q in range(n):
            together[q] = _shared(S, size, j, q) * H[j, q]
            apart[q] = H[j, q] - together[q]
        _expected_derivative(X, j, S[:, j], X, S, n, False, kernel, apart, sign, out)
        _expected_derivative(X, j, S[:, j], X, S, n, True, kernel, together, sign, out)


@njit(cache=True, nogil=True)
def _set_sizes(S: F32, n: int) -> F32:
    size = np.empty(n, np.float32)
    for j in range(n):
        size[j] = max(_ones(np.uint32(S[3, j])) + _ones(np.uint32(S[4, j])), 1)
    return size


@njit(cache=True, nogil=True)
def _shared(S: F32, size: F32, j: int, q: int) -> np.float32:
    """Share of the pairs of draws of members j and q that are one draw; a member without draws is its own."""
    both = _ones(np.uint32(S[3, j]) & np.uint32(S[3, q])) + _ones(np.uint32(S[4, j]) & np.uint32(S[4, q]))
    if j == q:
        return np.float32(1 / size[j])
    return np.float32(both / (size[j] * size[q]))


@njit(cache=True, nogil=True, inline="always")
def _ones(word: np.uint32) -> int:
    """Number of bits that are set."""
    v = word - ((word >> np.uint32(1)) & np.uint32(0x55555555))
    v = (v & np.uint32(0x33333333)) + ((v >> np.uint32(2)) & np.uint32(0x33333333))
    v = (v + (v >> np.uint32(4))) & np.uint32(0x0F0F0F0F)
    return int((v * np.uint32(0x01010101)) & np.uint32(0xFFFFFFFF)) >> 24


@njit(cache=True, nogil=True, fastmath=True)
def _expected_row(
    Z: F32,
    j: int,
    s: F32,
    X: F32,
    SX: F32,
    m: int,
    together: bool,
    kernel: Mixture,
    row: F32,
    work: F32,
    gain: F32,
) -> None:
    kind, weight, variance = kernel
    for q in range(m):
        row[q] = 0
    for k in range(len(kind)):
        w, per = weight[k], np.float32(_PER_WEIGHT[kind[k]])
        for q in range(m):
            work[q], gain[q] = 0, 1
        for d in range(len(w)):
            z, x, wd = Z[d, j], X[d], w[d]
            if d >= 3 or len(SX) == 0:
                g = _ONE / (_ONE + (s[d] if d < 3 else np.float32(0)) * wd * per)
                for q in range(m):
                    difference = x[q] - z
                    work[q] += wd * g * difference * difference
                    gain[q] *= g
            else:
                sd, sx = s[d], SX[d]
                # what points displaced together do not share
                less = np.float32(2) * np.sqrt(sd) if together else np.float32(0)
                for q in range(m):
                    g = _ONE / (_ONE + (sd + sx[q] - less * np.sqrt(sx[q])) * wd * per)
                    difference = x[q] - z
                    work[q] += wd * g * difference * difference
                    gain[q] *= g
        for q in range(m):
            gain[q] = variance[k] * np.sqrt(gain[q])
        if kind[k] == 0:
            for q in range(m):
                row[q] += gain[q] * exp_minus(np.sqrt(work[q]))
        elif kind[k] == 1:
            for q in range(m):
                t = np.sqrt(work[q])
                row[q] += gain[q] * (_ONE + t) * exp_minus(t)
        elif kind[k] == 2:
            for q in range(m):
                t = np.sqrt(work[q])
                row[q] += gain[q] * (_ONE + t + t * t * _THIRD) * exp_minus(t)
        else:
            for q in range(m):
                row[q] += gain[q] * exp_minus(work[q])


@njit(cache=True, nogil=True)
def _expected_derivative(
    Z: F32, j: int, s: F32, X: F32, SX: F32, m: int, together: bool, kernel: Mixture, h: F32, sign: float, out: F64
) -> None:
    """One row of the derivatives."""
    kind, weight, variance = kernel
    D = weight.shape[1]
    g = np.ones(D, np.float32)
    for k in range(len(kind)):
        per = np.float32(_PER_WEIGHT[kind[k]])
        for q in range(m):
            r2, gain = np.float32(0), _ONE
            for d in range(D):
                sd = np.float32(0)
                if d < 3:
                    sx = SX[d, q] if len(SX) else np.float32(0)
                    sd = (np.sqrt(s[d]) - np.sqrt(sx)) ** 2 if together else s[d] + sx
                g[d] = _ONE / (_ONE + sd * weight[k, d] * per)
                r2 += weight[k, d] * g[d] * (X[d, q] - Z[d, j]) ** 2
                gain *= g[d]
            t = np.sqrt(r2)
            e = np.float32(sign) * h[q] * variance[k] * np.sqrt(gain)
            # value, and minus twice the derivative in r2
            if kind[k] == 0:
                value = e * np.exp(-t)
                slope = value / max(t, np.float32(1e-6))
            elif kind[k] == 1:
                slope = e * np.exp(-t)
                value = slope * (_ONE + t)
            elif kind[k] == 2:
                value = e * np.exp(-t)
                slope = value * (_ONE + t) * _THIRD
                value *= _ONE + t + t * t * _THIRD
            else:
                value = e * np.exp(-r2)
                slope = 2 * value
            out[k, D] += 2 * value
            for d in range(D):
                moved = weight[k, d] * g[d] * g[d] * (X[d, q] - Z[d, j]) ** 2
                out[k, d] += slope * moved + value * (_ONE - g[d])
