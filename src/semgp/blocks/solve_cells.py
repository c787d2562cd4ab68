"""Cells split into blocks, each block's members gathered, and its posterior solved."""

from __future__ import annotations

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, I8, I16, I32, I64
from semgp.blocks.covariance import Mixture
from semgp.blocks.layout import Layout
from semgp.blocks.linear import pack, packed_size
from semgp.blocks.members import Members, Sizes, gather
from semgp.blocks.solve import Noise, solve_block
from semgp.blocks.solved import SHARED, Solved
from semgp.blocks.tree import split


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
