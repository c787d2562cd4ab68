"""From latent values to class probabilities: three predictors of one covariance, pooled, less a share of errors.

With the indicator mean m_c, the log-ratio mean z_c and the vote v_c at a point,

* indicators: p_c ~ max(m_c + pi_c, 0) + delta pi_c,
* log-ratios: p_c ~ pi_c exp(z_c),
* vote: p_c ~ v_c + v_0 pi_c,

each over its sum, and the pooled probability is proportional to the product of their powers (a logarithmic opinion
pool; Genest and Zidek, 1986). A model with weight on one of them alone has that predictor's probabilities.

A network errs most where it is least sure. With the pooled probability s_c, its largest m, and the mass q_o that
the labels leave to no class of the map, w = b ((1 - m) / m q_o)^k, u = w / (1 + w) and p_c = (1 - u) s_c + u r_c:
the share u of errors falls on the classes as r. Where labels always name a class, q_o is left out; with b = 0
there is no such share.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, I16
from semgp.blocks.elementary import exp_minus, log
from semgp.blocks.solved import SHARED

FLOOR = np.float32(1e-6)
"""Least value of what is divided by or raised to a power."""


class Link(NamedTuple):
    """What the link depends on.

    prior pi (C,), or (C + 1,) with the mass of no class last, if `other` is set. power: pi over the largest pi, to
    the sum of the weights. delta, v_0. The three weights. errors r (C,), error_rate b and error_power k.
    """

    prior: F32
    power: F32
    delta: np.float32
    v_0: np.float32
    indicator: np.float32
    log_ratio: np.float32
    vote: np.float32
    other: bool
    errors: F32
    error_rate: float
    error_power: float


@njit(cache=True, nogil=True, fastmath=True)
def class_probabilities(F: F32, present: I16, m: int, link: Link, p: F32) -> None:
    """Fill in p (P + 1, m): probabilities of the P present classes, and what an absent one's `power` multiplies.

    F (3 + 3 P, m) are the latent values: coefficients times covariances.
    """
    P = len(present)
    prior, delta, v_0 = link.prior, link.delta, link.v_0
    most = np.float32(0)
    for pi in prior:
        most = max(most, pi)
    w_i, w_l, w_v = link.indicator, link.log_ratio, link.vote
    peak = np.full(m, np.float32(-1e30), np.float32)
    for c in range(P + 1):
        row = p[c]
        pi = prior[present[c]] if c < P else most
        for q in range(m):
            row[q] = 0
        if w_i > 0:
            indicator = F[2 + c] if c < P else F[0]
            sign, offset = (np.float32(1), pi) if c < P else (-pi, pi)
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
        if c < P or len(prior) > P:
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
            p[c, q] = exp_minus(max(peak[q] - p[c, q], np.float32(0)))
            total[q] += share * p[c, q]
    for c in range(P + 1):
        for q in range(m):
            p[c, q] /= total[q]


@njit(cache=True, nogil=True)
def error_shares(p: F32, present: I16, m: int, link: Link, u: F32) -> None:
    """Fill in the share u (m,) of errors, and take it, and the mass of no class, from p (P + 1, m)."""
    P, C = len(present), len(link.prior)
    has_other = link.other and P > 0 and present[P - 1] == C - 1
    classes = P - 1 if has_other else P
    absent = np.float32(0)  # the largest of the absent classes' powers
    k = 0
    for c in range(C - 1 if link.other else C):
        if k < P and present[k] == c:
            k += 1
        else:
            absent = max(absent, link.power[c])
    for q in range(m):
        rest = np.float32(0)
        if link.other:
            rest = p[P - 1, q] if has_other else p[P, q] * link.power[C - 1]
        top = p[P, q] * absent
        for i in range(classes):
            top = max(top, p[i, q])
        left = max(np.float32(1) - rest, FLOOR)
        u[q] = 0
        if link.error_rate > 0:
            s = min(top / left, np.float32(1))
            odds = max(np.float32(1) - s, FLOOR) / s * (max(rest, FLOOR) if link.other else np.float32(1))
            w = np.float32(link.error_rate * odds**link.error_power)
            u[q] = w / (np.float32(1) + w)
        for i in range(P + 1):
            p[i, q] *= (np.float32(1) - u[q]) / left
