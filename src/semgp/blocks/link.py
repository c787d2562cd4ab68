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

from semgp.blocks.arrays import F32, I16
from semgp.blocks.elementary import exp_minus, log
from semgp.blocks.solve import SHARED


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
def class_probabilities(F: F32, present: I16, m: int, link: Link, p: F32) -> None:
    """Fill in p (P + 1, m): probabilities of the present classes, and what an absent one's pi_c power multiplies.

    F (3 + 3 P, m) are the latent values: coefficients times covariances.
    """
    P = len(present)
    prior, _, delta, v_0, w_i, w_l, w_v = link
    peak = np.full(m, np.float32(-1e30), np.float32)
    for c in range(P + 1):
        row = p[c]
        pi = prior[present[c]] if c < P else np.float32(1)
        for q in range(m):
            row[q] = 0
        if w_i > 0:
            indicator = F[2 + c] if c < P else F[0]
            sign, offset = (np.float32(1), pi) if c < P else (np.float32(-1), np.float32(1))
            for q in range(m):
                latent = offset + sign * indicator[q]
                row[q] += w_i * log(max(latent, np.float32(0)) + delta * pi)
        if w_l > 0:
            z = F[2 + P + c] if c < P else F[1]
            log_pi = np.log(pi)
            for q in range(m):
                row[q] += w_l * (z[q] + log_pi)
        if w_v > 0:
            votes = F[SHARED + 2 * P + c] if c < P else F[0]
            counted = np.float32(1) if c < P else np.float32(0)
            for q in range(m):
                row[q] += w_v * log(counted * votes[q] + v_0 * pi)
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
            p[c, q] = exp_minus(peak[q] - p[c, q])
            total[q] += share * p[c, q]
    for c in range(P + 1):
        for q in range(m):
            p[c, q] /= total[q]
