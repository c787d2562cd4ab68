"""Answers to be pooled."""

from typing import Any

import numpy as np

from semgp.classes import Classes
from semgp.prediction import OccupancyPrediction, Prediction


def prediction(
    p: Any, observed: Any = True, variance: Any = None, occupancy: OccupancyPrediction | None = None
) -> Prediction:
    p = np.atleast_2d(p)
    seen = np.broadcast_to(observed, len(p))
    v = None if variance is None else np.broadcast_to(np.asarray(variance, float), p.shape)
    classes = Classes(tuple(f"class {c}" for c in range(p.shape[1])))
    return Prediction(classes, p, seen, variance=v, occupancy=occupancy)
