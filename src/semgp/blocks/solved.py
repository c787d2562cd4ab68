"""Solved blocks as flat arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from semgp.blocks.arrays import F32, I16, I32, I64

SHARED = 3
"""Rows of coefficients that do not belong to one class: absent indicator, absent log-ratio, vote of all mass."""


class Solved(NamedTuple):
    """Posteriors of some cells' blocks, one after the other.

    n (B,): members. X (B, D, total), k (B, total): their positions, and the sites that they join. S (B, 5, total):
    variances of the positions, and two words of draws; (B, 0, total) if all are certain. n_present (B,), present
    (B, C): the classes with mass in the block. at (B + 1,), coefficients: where in the flat array each block's (3
    + 3 P, n) coefficients begin. at_factor (B + 1,), factor: the same for the inverse Cholesky factors, lower
    triangles row by row.
    """

    n: I32
    X: F32
    S: F32
    k: F32
    n_present: I32
    present: I16
    at: I64
    coefficients: F32
    at_factor: I64
    factor: F32


def class_mass(solved: Solved, b: int) -> F32:
    """Return the class masses (P, n) of the members of block b: the last rows of its coefficients."""
    n, P = int(solved.n[b]), int(solved.n_present[b])
    return solved.coefficients[solved.at[b] : solved.at[b + 1]].reshape(SHARED + 3 * P, n)[SHARED + 2 * P :]


def taken(solved: Solved, blocks: I64) -> Solved:
    """Return copies of some blocks' posteriors, in this order."""
    rows = [solved.coefficients[solved.at[b] : solved.at[b + 1]] for b in blocks]
    factors = [solved.factor[solved.at_factor[b] : solved.at_factor[b + 1]] for b in blocks]
    at, at_factor = (np.cumsum([0, *map(len, parts)], dtype=np.int64) for parts in (rows, factors))
    return Solved(
        solved.n[blocks], solved.X[blocks], solved.S[blocks], solved.k[blocks], solved.n_present[blocks],
        solved.present[blocks], at, np.concatenate(rows), at_factor, np.concatenate(factors),
    )  # fmt: skip
