"""Patches to learn from: blocks of some scans, and labels of other scans in the same places."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from semgp.blocks.arrays import F32, I16, I32, I64
from semgp.blocks.solved import Solved, class_mass


class Patch(NamedTuple):
    """A block, unsolved, and held-out points in its leaf.

    X (D, n), S (5, n) or (0, n), k (n,): members. present (P,). mass (P, n). Y (D, m), SY (3, m) or (0, m), label
    (m,): held-out points, the variances of their positions, and their classes.
    """

    X: F32
    S: F32
    k: F32
    present: I16
    mass: F32
    Y: F32
    SY: F32
    label: I32


def patch(solved: Solved, b: int, Y: F32, SY: F32, label: I32) -> Patch:
    """Return the patch of block b of a piece and held-out points (m, D), of variances (m, 3), with labels (m,).

    Where the block's positions are certain, so are the points'.
    """
    S = solved.S[b]
    n, P = int(solved.n[b]), int(solved.n_present[b])
    return Patch(
        solved.X[b, :, :n].copy(), S[:, :n].copy(), solved.k[b, :n].copy(), solved.present[b, :P].copy(),
        class_mass(solved, b).copy(), np.ascontiguousarray(Y.T), np.ascontiguousarray(SY.T if len(S) else
        SY.T[:0]), label,
    )  # fmt: skip


class Packed(NamedTuple):
    """Patches in flat arrays: sizes (B, 3) of n, P and m, and members, classes, masses and points in turn."""

    sizes: I64
    X: F32
    S: F32
    k: F32
    present: I16
    mass: F32
    Y: F32
    SY: F32
    label: I32


def packed(patches: Sequence[Patch]) -> Packed:
    """Return patches in flat arrays."""
    sizes = np.array([(len(p.k), len(p.present), len(p.label)) for p in patches], dtype=np.int64)
    X, S, k, present, mass, Y, SY, label = (
        np.concatenate([a.ravel() for a in column]) for column in zip(*patches)
    )
    return Packed(sizes, X, S, k, present, mass, Y, SY, label)
