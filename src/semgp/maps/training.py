"""The training set of one expert: which points, which classes, in which frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.gp.model import GPModel


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """Training points of the classes present.

    Parameters
    ----------
    origin : (3,) array
        Origin of the expert's frame in the world, metres; keeps the digits of large coordinates.
    X : (n, 3) array
        Points, less the origin.
    weights : (n, P) array
        Class weights; each row sums to one.
    present : (P,) int array
        The classes of the columns.
    """

    origin: NDArray[np.float64]
    X: NDArray[np.float64]
    weights: NDArray[np.float64]
    present: NDArray[np.int64]


def training_set(model: GPModel, points: NDArray[np.float64], weights: NDArray[np.floating]) -> TrainingSet:
    """Choose at most `model.max_points` of the labelled points, with the model's seed.

    Raises
    ------
    InputError
        No labelled points.
    """
    if not len(points):
        raise InputError("the map has no labelled point yet: update it with a cloud that has labels.")
    # order of arrival must not matter: the draw is from the sorted points
    order = np.lexsort(points.T)
    chosen = order[np.random.default_rng(model.seed).permutation(len(points))[: model.max_points]]
    X, w = points[chosen], weights[chosen].astype(np.float64)
    present = np.flatnonzero(w.sum(axis=0) > 0)
    origin = np.floor(points.min(axis=0))
    return TrainingSet(origin, X - origin, w[:, present] / w.sum(axis=1, keepdims=True), present)
