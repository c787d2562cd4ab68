"""Observations: labelled points on their way into sites, checked, and those of no weight left out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from semgp.blocks.accumulate import MASS_UNIT
from semgp.blocks.arrays import F32, F64, I32, I64
from semgp.errors import InputError

DRAWS = 48
"""Bits of a set of draws, see `Observations.draws`."""

_LARGEST_WEIGHT, _LARGEST_FEATURE, _LARGEST_VARIANCE = 64, 30_000, 100


class Observations(NamedTuple):
    """Labelled points and what belongs to them.

    points (N, 3): metres. labels (N,): hard labels, or None. weights (N, C): soft labels instead. features (N, F):
    inputs beyond position. confidence (N,): what each label counts, 0 to 1; None for 1. variances (N, 3): those of
    the positions, m^2; None where they are certain. draws (N,): with variances, one of `DRAWS` bits a point;
    points that are displaced together have the same.
    """

    points: F64
    labels: I32 | None
    weights: F32 | None
    features: F32
    confidence: F32 | None = None
    variances: F64 | None = None
    draws: I64 | None = None


def require_summable(given: Observations) -> None:
    """Raise InputError for weights, features or variances beyond what a sum can hold."""
    weights, features, variances = given.weights, given.features, given.variances
    if not len(given.points):
        return
    if variances is not None and variances.max() > _LARGEST_VARIANCE:
        raise InputError(
            f"positions must be known to {math.sqrt(_LARGEST_VARIANCE):g} m, a variance of "
            f"{_LARGEST_VARIANCE} m^2: drop points that are less certain."
        )
    if weights is not None and weights.max() > _LARGEST_WEIGHT:
        raise InputError(f"weights of soft labels must be {_LARGEST_WEIGHT} at most: divide them.")
    if np.abs(features).max(initial=0) > _LARGEST_FEATURE:
        raise InputError(f"features must lie within {_LARGEST_FEATURE} of 0: scale them.")


def counted(given: Observations) -> tuple[Observations, I64]:
    """Return the observations that count, and the mass of each (N,) in steps of 1 / `MASS_UNIT`.

    Raises
    ------
    InputError
        Weights, features or variances beyond what a sum can hold.
    """
    points, labels, weights, features, confidence, variances, draws = given
    amounts = np.full(len(points), MASS_UNIT)
    if not len(points):
        return given, amounts
    require_summable(given)
    if confidence is not None:
        amounts = np.rint(confidence * MASS_UNIT).astype(np.int64)
    heavy = amounts > 0
    if weights is not None:
        weights = weights if confidence is None else weights * confidence[:, None]
        heavy = np.rint(weights * MASS_UNIT).sum(axis=1) > 0
    if heavy.all():
        return given._replace(weights=weights), amounts
    return Observations(
        points[heavy],
        None if labels is None else labels[heavy],
        None if weights is None else weights[heavy],
        features[heavy],
        None,
        None if variances is None else variances[heavy],
        None if draws is None else draws[heavy],
    ), amounts[heavy]
