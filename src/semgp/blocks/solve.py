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

from semgp.blocks.arrays import F32, I8, I16, I32, I64
from semgp.blocks.covariance import Mixture
from semgp.blocks.layout import Layout
from semgp.blocks.linear import inverse_factor, pack, packed_size
from semgp.blocks.members import Members, Sizes, gather
from semgp.blocks.solved import SHARED, Solved
from semgp.blocks.tree import split
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
def solve_cells(
    layout: Layout,
    places: I64,
    around: I32,
    edge: float,
    sizes: Sizes,
    kernel: Mixture,
    noise: Noise,
    leaves: I64,
    tree_at: I64,
    axes: I8,
    cuts: F32,
    factor: F32,
) -> Solved:
    """Split cells into blocks and solve each.

    Parameters
    ----------
    layout : Layout
        The cells and those round about.
    places : (n,) array
        Places of the cells in the layout.
    around : (n, 27) array
        Places of the cells round about each, -1 for none.
    edge : float
        Edge of a cell in metres.
    sizes, kernel, noise
        The model.
    leaves, tree_at : (n,) arrays
        Leaves of each cell's tree, and where it begins in `axes` and `cuts`.
    axes, cuts : arrays
        The trees' planes, filled in.
    factor : array
        Room for the blocks' factors.
    """
    T, D, C = sizes.total, layout.X.shape[1], layout.mass.shape[1]
    U = 5 if len(layout.S) else 0
    B = leaves.sum()
    solved = Solved(
        np.zeros(B, np.int32),
        np.empty((B, D, T), np.float32),
        np.empty((B, U, T), np.float32),
        np.empty((B, T), np.float32),
        np.zeros(B, np.int32),
        np.empty((B, C), np.int16),
        np.zeros(B + 1, np.int64),
        np.empty(B * T * (SHARED + 3 * min(C, 6)), np.float32),
        np.zeros(B + 1, np.int64),
        factor,
    )
    coefficients = solved.coefficients
    marks = np.full(len(layout.row), -1, np.int32)
    X, S = np.empty((D, T), np.float32), np.empty((U, T), np.float32)
    members = Members(X, S, np.empty((T, C), np.float32), np.empty(T, np.float32))
    K, work, inverse = np.empty(T * T, np.float32), np.empty(T, np.float32), np.empty(T * T, np.float32)
    b = -1
    for i in range(len(places)):
        cell, n_leaves = places[i], leaves[i]
        a, n_sites = layout.start[cell], layout.start[cell + 1] - layout.start[cell]
        order, bounds = np.empty(n_sites, np.int64), np.empty(n_leaves + 1, np.int64)
        t, size = tree_at[i], n_leaves - 1
        split(layout.X[a : a + n_sites], order, n_leaves, axes[t : t + size], cuts[t : t + size], bounds)
        for leaf in range(n_leaves):
            b += 1
            own = order[bounds[leaf] : bounds[leaf + 1]] + a
            n = gather(layout, around[i], own, edge, sizes, marks, b, members)
            P = _present(members.mass, n, solved.present[b])
            W = SHARED + 3 * P
            if solved.at[b] + W * n > len(coefficients):
                longer = np.empty(max(2 * len(coefficients), solved.at[b] + W * n), np.float32)
                for j in range(solved.at[b]):
                    longer[j] = coefficients[j]
                coefficients = longer
            solved.n[b], solved.n_present[b] = n, P
            for j in range(n):
                solved.k[b, j] = members.k[j]
                for d in range(D):
                    solved.X[b, d, j] = members.X[d, j]
                for d in range(U):
                    solved.S[b, d, j] = members.S[d, j]
            solved.at[b + 1] = solved.at[b] + W * n
            solved.at_factor[b + 1] = solved.at_factor[b] + (packed_size(n) if noise.solve else 0)
            rows = coefficients[solved.at[b] : solved.at[b + 1]].reshape(W, n)
            for j in range(n):
                rows[2 + 2 * P, j] = 0
                for p in range(P):
                    rows[3 + 2 * P + p, j] = members.mass[j, solved.present[b, p]]
                    rows[2 + 2 * P, j] += rows[3 + 2 * P + p, j]
            if noise.solve and n:
                L_inverse = inverse[: n * n].reshape(n, n)
                solve_block(
                    members.X,
                    members.S,
                    members.k,
                    n,
                    solved.present[b, :P],
                    kernel,
                    noise,
                    rows,
                    L_inverse,
                    K,
                    work,
                )
                pack(L_inverse, solved.factor[solved.at_factor[b] : solved.at_factor[b + 1]])
            else:
                for w in range(2 + 2 * P):
                    for j in range(n):
                        rows[w, j] = 0
    return Solved(
        solved.n,
        solved.X,
        solved.S,
        solved.k,
        solved.n_present,
        solved.present,
        solved.at,
        coefficients[: solved.at[B]],
        solved.at_factor,
        solved.factor,
    )


@njit(cache=True, nogil=True)
def _present(mass: F32, n: int, present: I16) -> int:
    """Fill in the classes that have mass, in ascending order, and return their number."""
    P = 0
    for c in range(mass.shape[1]):
        for j in range(n):
            if mass[j, c] > 0:
                present[P] = c
                P += 1
                break
    return P


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
