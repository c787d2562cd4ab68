"""Checks that all metrics share: arrays that fit, and only the points whose truth is known."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING
from semgp.errors import InputError


def true_labels(truth: ArrayLike, n_points: int, n_classes: int) -> NDArray[np.int64]:
    """Check true labels (N,) against the number of points and classes.

    Raises
    ------
    InputError
        Another shape, labels that are no whole numbers, or labels out of range.
    """
    y = np.asarray(truth)
    if y.shape != (n_points,):
        raise InputError(f"truth must have shape ({n_points},) to go with the points, not {y.shape}.")
    if n_points and y.dtype.kind not in "iu":
        raise InputError(f"truth must be whole numbers, not {y.dtype}; a missing label is {MISSING}.")
    if n_points and (y.min() < MISSING or y.max() >= n_classes):
        raise InputError(
            f"truth goes from {y.min()} to {y.max()}, but with {n_classes} classes it must lie between 0 and "
            f"{n_classes - 1}, or be {MISSING} where missing."
        )
    return y.astype(np.int64)


def scored_points(score: ArrayLike, truth: ArrayLike) -> tuple[NDArray[np.floating], NDArray[np.int64]]:
    """Check scores (N, C) and truth (N,), and return both for the points whose truth is known.

    Raises
    ------
    InputError
        Shapes that do not agree, labels out of range, or scores that are NaN.
    """
    S: NDArray[Any] = np.asarray(score)
    if S.ndim != 2 or S.dtype.kind not in "fiu":
        raise InputError(f"scores must be numbers of shape (N, C), not {S.dtype} of shape {S.shape}.")
    y = true_labels(truth, *S.shape)
    if np.isnan(S).any():
        raise InputError("scores must not be NaN: give points without an answer to `score` as not observed.")
    known = y != MISSING
    return (S, y) if known.all() else (S[known], y[known])


def probabilities(probability: ArrayLike, truth: ArrayLike) -> tuple[NDArray[np.floating], NDArray[np.int64]]:
    """Check probabilities as `scored_points` does, and that they lie between 0 and 1.

    Raises
    ------
    InputError
        As `scored_points`, and for values below 0 or above 1 (but for rounding).
    """
    p, y = scored_points(probability, truth)
    if p.size and (p.min() < 0 or p.max() > 1 + 1e-4):
        raise InputError(f"probabilities must lie between 0 and 1, not {p.min():g} and {p.max():g}.")
    return p, y
