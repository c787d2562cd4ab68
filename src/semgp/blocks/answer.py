"""The blocks' answers: latent means and variance at the points of each block, turned into probabilities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, I16, I64
from semgp.blocks.covariance import Mixture
from semgp.blocks.linear import unpack
from semgp.blocks.link import Link, class_probabilities, error_shares
from semgp.blocks.pairs import Pairs
from semgp.blocks.solved import SHARED, Solved
from semgp.blocks.uncertain import cross_covariance

TILE = 64
"""Points that are answered together: their covariances with a block stay in the cache."""


class Answers(NamedTuple):
    """What is added up: probability (M, C) and latent variance (M,), which all classes share."""

    probability: F32
    variance: F32


@njit(cache=True, nogil=True)
def answer_pairs(
    solved: Solved,
    pairs: Pairs,
    order: I64,
    block: I64,
    features: F32,
    kernel: Mixture,
    link: Link,
    answers: Answers,
) -> None:
    """Add the answers to some pairs, sorted by block, all of blocks in `solved`.

    Parameters
    ----------
    solved : Solved
        Posteriors.
    pairs : Pairs
        All pairs.
    order : (n,) array
        The pairs to answer, by block.
    block : (n,) array
        The place of the block of each in `solved`.
    features : (M, F) array
        The points' inputs beyond position; where NaN, that of the block's nearest member.
    kernel : Mixture
        The covariance function.
    link : Link
        From latent values to probabilities.
    answers : Answers
        Where to add.
    """
    D, T = solved.X.shape[1], solved.X.shape[2]
    most = SHARED + 3 * solved.present.shape[1]
    X, work, variance = np.empty((D, TILE), np.float32), np.empty(T, np.float32), np.empty(TILE, np.float32)
    K_flat, V_flat = np.empty(T * TILE, np.float32), np.empty(T * TILE, np.float32)
    F_flat, p_flat = np.empty(most * TILE, np.float32), np.empty(most * TILE, np.float32)
    u = np.zeros(TILE, np.float32)
    prior_variance = np.float32(0)
    for k in range(len(kernel.variance)):
        prior_variance += kernel.variance[k]
    L_flat, certain = np.empty(T * T, np.float32), np.empty((0, TILE), np.float32)
    unpacked = -1
    begin = 0
    while begin < len(order):
        b = block[begin]
        end = begin + 1
        while end < len(order) and end - begin < TILE and block[end] == b:
            end += 1
        m = end - begin
        n, P = solved.n[b], solved.n_present[b]
        W = SHARED + 3 * P
        Z = solved.X[b]
        for q in range(m):
            pair = order[begin + q]
            for d in range(3):
                X[d, q] = pairs.local[pair, d]
            if D > 3:
                _fill_features(X, q, features[pairs.point[pair]], Z, n)
        K = K_flat[: m * n].reshape(m, n)  # a row has all members, whole vectors, however few the points
        cross_covariance(X, certain, m, Z, solved.S[b], n, kernel, K, work)
        F = F_flat[: W * m].reshape(W, m)
        np.dot(solved.coefficients[solved.at[b] : solved.at[b + 1]].reshape(W, n), K.T, F)
        if solved.at_factor[b + 1] > solved.at_factor[b]:
            V, L_inverse = V_flat[: m * n].reshape(m, n), L_flat[: n * n].reshape(n, n)
            if unpacked != b:
                unpack(solved.factor[solved.at_factor[b] : solved.at_factor[b + 1]], L_inverse)
                unpacked = b
            np.dot(K, L_inverse.T, V)
            _unexplained(V, prior_variance, variance)
        else:
            _explained_by_vote(F[2 + 2 * P], prior_variance, link.v_0, variance, m)
        p = p_flat[: (P + 1) * m].reshape(P + 1, m)
        class_probabilities(F, solved.present[b, :P], m, link, p)
        if link.other or link.error_rate > 0:
            error_shares(p, solved.present[b, :P], m, link, u)
        _add(pairs, order, begin, m, solved.present[b, :P], p, u, variance, link, answers)
        begin = end


@njit(cache=True, nogil=True)
def answer_prior(pairs: Pairs, order: I64, prior_variance: float, probability: F32, answers: Answers) -> None:
    """Add what is known without data, `probability` (C,), for pairs without a block."""
    for i in order:
        point, w = pairs.point[i], pairs.weight[i]
        for c in range(len(probability)):
            answers.probability[point, c] += w * probability[c]
        answers.variance[point] += w * np.float32(prior_variance)


def prior_probabilities(link: Link, n_classes: int) -> F32:
    """Return the probabilities (C,) far from all data: what every pooled answer tends to."""
    p, u, nothing = np.empty((1, 1), np.float32), np.zeros(1, np.float32), np.empty(0, np.int16)
    class_probabilities(np.zeros((SHARED, 1), np.float32), nothing, 1, link, p)
    if link.other or link.error_rate > 0:
        error_shares(p, nothing, 1, link, u)
    return np.asarray(p[0, 0] * link.power[:n_classes] + u[0] * link.errors, dtype=np.float32)


@njit(cache=True, nogil=True)
def _fill_features(X: F32, q: int, given: F32, Z: F32, n: int) -> None:
    nearest, least = 0, np.float32(np.inf)
    if np.isnan(given).any():
        for j in range(n):
            r2 = (X[0, q] - Z[0, j]) ** 2 + (X[1, q] - Z[1, j]) ** 2 + (X[2, q] - Z[2, j]) ** 2
            if r2 < least:
                nearest, least = j, r2
    for f in range(len(given)):
        X[3 + f, q] = Z[3 + f, nearest] if np.isnan(given[f]) else given[f]


@njit(cache=True, nogil=True, fastmath=True)
def _unexplained(V: F32, prior_variance: np.float32, variance: F32) -> None:
    """Fill in the prior's variance less what the members explain."""
    for q in range(V.shape[0]):
        row, explained = V[q], np.float32(0)
        for j in range(V.shape[1]):
            explained += row[j] * row[j]
        variance[q] = max(prior_variance - explained, np.float32(0))


@njit(cache=True, nogil=True)
def _explained_by_vote(mass: F32, prior_variance: np.float32, v_0: np.float32, variance: F32, m: int) -> None:
    """Without a solve, the prior's share of the vote stands for what is not known."""
    for q in range(m):
        variance[q] = prior_variance * v_0 / (v_0 + mass[q])


@njit(cache=True, nogil=True)
def _add(
    pairs: Pairs,
    order: I64,
    begin: int,
    m: int,
    present: I16,
    p: F32,
    u: F32,
    variance: F32,
    link: Link,
    answers: Answers,
) -> None:
    P = len(present)
    for q in range(m):
        pair = order[begin + q]
        point, w = pairs.point[pair], pairs.weight[pair]
        answers.variance[point] += w * variance[q]
        out, absent = answers.probability[point], w * p[P, q]
        k = 0
        for c in range(len(out)):
            if k < P and present[k] == c:
                out[c] += w * (p[k, q] + u[q] * link.errors[c])
                k += 1
            else:
                out[c] += absent * link.power[c] + w * u[q] * link.errors[c]
