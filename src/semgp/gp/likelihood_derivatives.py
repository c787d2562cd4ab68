"""Compiled log-likelihoods and derivatives, exact to rounding in both tails.

In the far lower tail, x = -y f > 5, Phi(-x) / N(x) is Mills' ratio, whose continued fraction
1 / (x + 1 / (x + 2 / (x + 3 / ...))) gives each derivative as a product without cancellation
(Abramowitz & Stegun, 26.2.14). The textbook form n (n + z), n = N(z) / Phi(z), loses all digits there.
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
def probit_derivatives(y: Array, f: Array) -> tuple[Array, Array, Array, Array]:
    """Return log Phi(y f) and its first three derivatives in f."""
    n = len(f)
    log_p, d1, d2, d3 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        z = y[i] * f[i]
        if z > -_TAIL:
            p = 0.5 * math.erfc(-z * _SQRT_HALF)
            # log1p keeps the digits of log p where p is close to one
            log_p[i] = math.log(p) if z < 1 else math.log1p(-0.5 * math.erfc(z * _SQRT_HALF))
            ratio = _INV_SQRT_2PI * math.exp(-0.5 * z * z) / p
            c = ratio + z
            d1[i] = y[i] * ratio
            d2[i] = -ratio * c
            d3[i] = y[i] * ratio * (c * c + ratio * c - 1)
        else:
            x = -z
            h = 0.0
            for k in range(_TERMS, 3, -1):
                h = k / (x + h)
            g = 3 / (x + h)
            e = 2 / (x + g)
            c = 1 / (x + e)
            ratio = x + c
            log_p[i] = -0.5 * x * x - _LOG_SQRT_2PI - math.log(ratio)
            d1[i] = y[i] * ratio
            d2[i] = -ratio * c
            # c^2 + ratio c - 1 = c (2 c - e), and 2 c - e = 2 (g - e) / ((x + e) (x + g))
            g_minus_e = (x + 3 * g - 2 * h) / ((x + h) * (x + g))
            d3[i] = y[i] * ratio * c * 2 * g_minus_e * c / (x + g)
    return log_p, d1, d2, d3


@njit(cache=True, nogil=True)
def logistic_derivatives(y: Array, f: Array) -> tuple[Array, Array, Array, Array]:
    """Return log 1 / (1 + exp(-y f)) and its first three derivatives in f."""
    n = len(f)
    log_p, d1, d2, d3 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        z = y[i] * f[i]
        e = math.exp(-abs(z))
        log_p[i] = min(z, 0.0) - math.log1p(e)
        small, large = e / (1 + e), 1 / (1 + e)
        d1[i] = y[i] * (small if z > 0 else large)
        d2[i] = -small * large
        d3[i] = -small * large * (1 - e) / (1 + e) * (-1.0 if f[i] > 0 else 1.0)
    return log_p, d1, d2, d3
