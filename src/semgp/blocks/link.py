"""From latent values to class probabilities: three predictors of one covariance, pooled.

With the indicator mean m_c, the log-ratio mean z_c and the vote v_c at a point,

* indicators: p_c ~ max(m_c + pi_c, 0) + delta pi_c,
* log-ratios: p_c ~ pi_c exp(z_c),
* vote: p_c ~ v_c + v_0 pi_c,

each over its sum, and the pooled probability is proportional to the product of their powers (a logarithmic opinion
pool; Genest and Zidek, 1986). A model with weight on one of them alone has that predictor's probabilities.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.blocks.solve import SHARED

F32 = NDArray[np.float32]


class Link(NamedTuple):
    """prior pi (C,), its power (C,) with the sum of the weights, delta, v_0, and the three weights."""

    prior: F32
    power: F32
    delta: np.float32
    v_0: np.float32
    indicator: np.float32
    log_ratio: np.float32
    vote: np.float32


@njit(cache=True, nogil=True, fastmath=True)
def class_probabilities(F: F32, present: NDArray[np.int16], m: int, link: Link, p: F32) -> None:
    """Fill in p (P + 1, m): probabilities of the present classes, and what an absent one's pi_c power multiplies.

    F (3 + 3 P, m) are the latent values: coefficients times covariances.
    """
    P = len(present)
    prior, _, delta, v_0, w_i, w_l, w_v = link
    floor, top = np.float32(1e-30), np.float32(-1e30)
    peak = np.full(m, top, np.float32)
    for c in range(P + 1):
        row = p[c]
        pi = prior[present[c]] if c < P else np.float32(1)
        for q in range(m):
            row[q] = 0
        if w_i > 0:
            for q in range(m):
                latent = F[2 + c, q] + pi if c < P else np.float32(1) - F[0, q]
                row[q] += w_i * np.log(max(max(latent, np.float32(0)) + delta * pi, floor))
        if w_l > 0:
            z = F[2 + P + c] if c < P else F[1]
            log_pi = np.log(pi)
            for q in range(m):
                row[q] += w_l * (z[q] + log_pi)
        if w_v > 0:
            for q in range(m):
                v = F[SHARED + 2 * P + c, q] if c < P else np.float32(0)
                row[q] += w_v * np.log(max(v + v_0 * pi, floor))
        if c < P:
            for q in range(m):
                peak[q] = max(peak[q], row[q])
        else:
            for q in range(m):
                peak[q] = max(peak[q], row[q])
    rest = np.float32(0)
    is_present = np.zeros(len(prior), np.bool_)
    for c in present:
        is_present[c] = True
    for c in range(len(prior)):
        if not is_present[c]:
            rest += link.power[c]
    total = np.zeros(m, np.float32)
    for c in range(P + 1):
        share = np.float32(1) if c < P else rest
        for q in range(m):
            p[c, q] = np.exp(p[c, q] - peak[q])
            total[q] += share * p[c, q]
    for c in range(P + 1):
        for q in range(m):
            p[c, q] /= total[q]
