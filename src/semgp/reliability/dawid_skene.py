"""The EM algorithm of Dawid and Skene (1979), with one matrix of errors that all annotators share.

Item v has a true class t with probability f_t; each vote on it says k with probability M_tk, independently given
t. For N_vk votes the posterior of the true class is R_vt proportional to f_t prod_k M_tk^N_vk (E-step, their
equation 2.5), and the most probable parameters have M_tk proportional to sum_v R_vt N_vk and f_t to sum_v R_vt,
with the pseudo-counts of Dirichlet priors added (M-step, their 2.3 and 2.4). No step lowers the penalised
likelihood.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgp.parallel import parallel_map, slices

_SLICE = 1 << 14
_TOLERANCE = 1e-6  # nats a vote
F64 = NDArray[np.float64]


class Errors(NamedTuple):
    """M (C, C), in row t what is said where t is true, and frequencies f (C,): probabilities or pseudo-counts."""

    matrix: F64
    frequencies: F64


class Expected(NamedTuple):
    """Expected counts of true and said class (C, C), of true classes (C,), and the log-likelihood."""

    said: F64
    true: F64
    log_likelihood: float


class Fit(NamedTuple):
    """What `fit` found; the objective is the penalised log-likelihood, nats a vote."""

    errors: Errors
    objective: float
    iterations: int
    converged: bool


def fit(N: Any, prior: Errors, iterations: int) -> Fit:
    """Return the errors of votes N, a sparse (V, C) array in rows, each row not empty.

    Starts where each item's true class is what is said of it, in shares.

    Parameters
    ----------
    N : (V, C) scipy.sparse.csr_array
        Votes; fractions of votes will do.
    prior : Errors
        Pseudo-counts, all of them positive.
    iterations : int
        Limit of steps, one at least.
    """
    total = N.sum(axis=1)
    shares = N.multiply(1 / total[:, None]).tocsr()
    expected = Expected((shares.T @ N).toarray(), shares.sum(axis=0), -np.inf)
    last = -np.inf
    for i in range(1, iterations + 1):
        errors = maximise(expected, prior)
        expected = expect(N, errors)
        penalty = sum(float((n * np.log(p)).sum()) for n, p in zip(prior, errors))
        objective = (expected.log_likelihood + penalty) / float(total.sum())
        if objective - last < _TOLERANCE:
            return Fit(errors, objective, i, True)
        last = objective
    return Fit(errors, objective, iterations, False)


def maximise(expected: Expected, prior: Errors) -> Errors:
    """M-step: the most probable errors for expected counts."""
    said, true = expected.said + prior.matrix, expected.true + prior.frequencies
    return Errors(said / said.sum(axis=1, keepdims=True), true / true.sum())


def expect(N: Any, errors: Errors) -> Expected:
    """E-step: the expected counts for errors."""
    log_M, log_f = np.log(errors.matrix), np.log(errors.frequencies)

    def part(rows: slice) -> Expected:
        votes = N[rows]
        joint = votes @ log_M.T + log_f
        highest = joint.max(axis=1, keepdims=True)
        R = np.exp(joint - highest)
        total = R.sum(axis=1, keepdims=True)
        R /= total
        return Expected((votes.T @ R).T, R.sum(axis=0), float((highest + np.log(total)).sum()))

    said, true, log_likelihood = zip(*parallel_map(part, slices(N.shape[0], _SLICE)))
    return Expected(sum(said[1:], said[0]), sum(true[1:], true[0]), sum(log_likelihood))
