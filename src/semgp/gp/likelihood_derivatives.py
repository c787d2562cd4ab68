"""Compiled log-likelihoods and derivatives, exact to rounding in both tails.

In the far lower tail, x = -z > 5, Phi(-x) / N(x) is Mills' ratio, whose continued fraction
1 / (x + 1 / (x + 2 / (x + 3 / ...))) gives each derivative as a product without cancellation
(Abramowitz & Stegun, 26.2.14). The textbook form n (n + z), n = N(z) / Phi(z), loses all digits there.

A target y = +1 or -1 is a label; one between is a soft label, of probability (1 + y) / 2 for +1, and the
log-likelihood is the mean of both labels'.
"""

import math

import numpy as np
from numba import njit

from semgp.gp.kernels import Array

_SQRT_HALF = math.sqrt(0.5)
_INV_SQRT_2PI = 1 / math.sqrt(2 * math.pi)
_LOG_SQRT_2PI = 0.5 * math.log(2 * math.pi)
_TAIL = 5.0
_TERMS = 60


@njit(cache=True, nogil=True)
def _log_ndtr(z: float) -> tuple[float, float, float, float]:
    """Return log Phi(z) and its first three derivatives."""
    if z > -_TAIL:
        p = 0.5 * math.erfc(-z * _SQRT_HALF)
        # log1p keeps the digits of log p where p is close to one
        log_p = math.log(p) if z < 1 else math.log1p(-0.5 * math.erfc(z * _SQRT_HALF))
        n = _INV_SQRT_2PI * math.exp(-0.5 * z * z) / p
        c = n + z
        return log_p, n, -n * c, n * (c * c + n * c - 1)
    x = -z
    h = 0.0
    for k in range(_TERMS, 3, -1):
        h = k / (x + h)
    g = 3 / (x + h)
    e = 2 / (x + g)
    c = 1 / (x + e)
    n = x + c
    # c^2 + n c - 1 = c (2 c - e) and 2 c - e = 2 c (g - e) / (x + g), g - e = (x + 3 g - 2 h) / ((x + h) (x + g))
    third = 2 * n * c * c * (x + 3 * g - 2 * h) / ((x + h) * (x + g) * (x + g))
    return -0.5 * x * x - _LOG_SQRT_2PI - math.log(n), n, -n * c, third


@njit(cache=True, nogil=True)
def _log_expit(z: float) -> tuple[float, float, float, float]:
    """Return log 1 / (1 + exp(-z)) and its first three derivatives."""
    e = math.exp(-abs(z))
    small, large = e / (1 + e), 1 / (1 + e)
    third = small * large * (1 - e) / (1 + e)
    if z > 0:
        return -math.log1p(e), small, -small * large, third
    return z - math.log1p(e), large, -small * large, -third


@njit(cache=True, nogil=True)
def probit_derivatives(y: Array, f: Array) -> tuple[Array, Array, Array, Array]:
    """Return log p(y | f) = log Phi(y f) and its first three derivatives in f."""
    n = len(f)
    log_p, d1, d2, d3 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        sign = 1.0 if y[i] >= 0 else -1.0
        l, a, b, c = _log_ndtr(sign * f[i])
        log_p[i], d1[i], d2[i], d3[i] = l, sign * a, b, sign * c
        other = 0.5 * (1 - abs(y[i]))
        if other > 0:
            l, a, b, c = _log_ndtr(-sign * f[i])
            log_p[i] += other * (l - log_p[i])
            d1[i] += other * (-sign * a - d1[i])
            d2[i] += other * (b - d2[i])
            d3[i] += other * (-sign * c - d3[i])
    return log_p, d1, d2, d3


@njit(cache=True, nogil=True)
def logistic_derivatives(y: Array, f: Array) -> tuple[Array, Array, Array, Array]:
    """Return log p(y | f) = log 1 / (1 + exp(-y f)) and its first three derivatives in f."""
    n = len(f)
    log_p, d1, d2, d3 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        sign = 1.0 if y[i] >= 0 else -1.0
        l, a, b, c = _log_expit(sign * f[i])
        log_p[i], d1[i], d2[i], d3[i] = l, sign * a, b, sign * c
        other = 0.5 * (1 - abs(y[i]))
        if other > 0:
            # log p(-f) = log p(f) - f: only the first two terms differ
            log_p[i] -= other * sign * f[i]
            d1[i] -= other * sign
    return log_p, d1, d2, d3
