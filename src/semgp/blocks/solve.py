"""The closed-form posteriors of blocks: one covariance and one factor for all classes and both kinds of targets.

With class mass n_jc, n_j = sum_c n_jc and the prior class probabilities pi_c, the targets of member j are

* indicators: n_jc / n_j - pi_c, and
* log-ratios: log((n_jc + a pi_c) / (n_j + a)) - log pi_c.

A = K + diag(s_n / n_j + nugget / k_j) is the same for all of them. A class without mass in the block has targets
that are the same for each such class, up to the factor pi_c: two more columns serve all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, I16
from semgp.blocks.covariance import Mixture
from semgp.blocks.linear import inverse_factor
from semgp.blocks.uncertain import member_covariance

JITTER = 3e-5
"""Noise added to every member, times the prior variance: single precision factors nothing closer to singular."""


class Noise(NamedTuple):
    """What targets and noise depend on: s_n, nugget, a, the prior pi (C,), and whether to solve at all."""

    s_n: float
    nugget: float
    a: float
    prior: F32
    solve: bool


@njit(cache=True, nogil=True)
def solve_block(
    X: F32,
    S: F32,
    k: F32,
    n: int,
    present: I16,
    kernel: Mixture,
    noise: Noise,
    rows: F32,
    factor: F32,
    K_flat: F32,
    work: F32,
) -> None:
    """Fill in the coefficients of a block, and its inverse factor, from the class masses in its last rows.

    Parameters
    ----------
    X, S, k : (D, .), (5, .) or (0, .), (.,) arrays
        Positions, their variances and draws, and the number of sites joined, of the first n members.
    n : int
        Members.
    present : (P,) array
        The classes with mass.
    kernel, noise
        The model.
    rows : (3 + 3 P, n) array
        The last P + 1 rows hold all mass and the class masses; the others are filled in.
    factor : (n, n) array
        Filled in.
    K_flat, work : arrays
        Scratch for n * n and n numbers.
    """
    P = len(present)
    _targets(rows, n, present, noise)
    A = K_flat[: n * n].reshape(n, n)
    jitter = np.float32(0)
    for v in kernel.variance:
        jitter += np.float32(JITTER) * v
    member_covariance(X, S, n, kernel, A, work)
    for j in range(n):
        A[j, j] += np.float32(noise.s_n) / rows[2 + 2 * P, j] + np.float32(noise.nugget) / k[j] + jitter
    inverse_factor(A, factor)
    found = np.dot(np.dot(rows[: 2 + 2 * P], factor.T), factor)
    for w in range(2 + 2 * P):
        for j in range(n):
            rows[w, j] = found[w, j]


@njit(cache=True, nogil=True, fastmath=True)
def _targets(rows: F32, n: int, present: I16, noise: Noise) -> None:
    """Fill in the targets, one row each: 1, absent log-ratio, indicators, log-ratios.

    The first row is solved to A^-1 1: an absent class has the indicator -pi_c everywhere.
    """
    P = len(present)
    a = np.float32(noise.a)
    for j in range(n):
        total = rows[2 + 2 * P, j]
        log_total = np.log(total + a)
        rows[0, j], rows[1, j] = 1, np.log(a) - log_total
        for p in range(P):
            m, pi = rows[3 + 2 * P + p, j], noise.prior[present[p]]
            rows[2 + p, j] = m / total - pi
            rows[2 + P + p, j] = np.log(m + a * pi) - log_total - np.log(pi)
