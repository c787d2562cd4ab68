"""Maps whose field, and so whose surface, is known."""

from collections.abc import Callable
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.upward import Up

F64 = NDArray[np.float64]


TWO = Classes(("low", "high"), ((200, 30, 30), (30, 30, 200)))


class AnalyticMap:
    """A map that knows its field: log-odds of occupancy at points, everywhere or where `known` says.

    The upper class lies above z = 0; for positive x there are no labels next to the surface.
    """

    kind = "analytic"
    up: Up = "z"
    classes = TWO
    resolution = 0.1

    def __init__(self, log_odds: Callable[[F64], F64], occupied: F64, free: F64) -> None:
        self.log_odds = log_odds
        self.occupied_positions, self.free_positions = occupied, free
        self.positions = occupied
        self.known: Callable[[F64], NDArray[np.bool_]] = lambda X: np.ones(len(X), dtype=bool)
        self.largest_query = 0

    def query(self, points: ArrayLike) -> Prediction:
        X = np.asarray(points)
        self.largest_query = max(self.largest_query, len(X))
        g = self.log_odds(X)
        p = expit(g)
        high = expit(X[:, 2] / 0.02)
        probability = np.stack([1 - high, high], axis=1)
        variance = np.stack([1 + X[:, 0] ** 2, 2 + X[:, 0] ** 2], axis=1)
        occupancy = OccupancyPrediction(p, self.known(X))
        observed = (X[:, 0] < 0) | (np.abs(g) > 0.02)
        return Prediction(TWO, probability, observed, variance=variance, occupancy=occupancy)

    def occupancy(self, points: ArrayLike) -> OccupancyPrediction:
        occupancy = self.query(points).occupancy
        assert occupancy is not None
        return occupancy

    def update(self, cloud: LabelledCloud) -> None: ...

    def __len__(self) -> int:
        return len(self.positions)

    def info(self) -> dict[str, Any]:
        return {}

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        return {}, {}

    @classmethod
    def from_arrays(cls, *_: Any) -> Self:
        raise NotImplementedError


def grid(low: float, high: float, spacing: float = 0.05) -> F64:
    axis = np.arange(low, high + spacing / 2, spacing)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def solid(distance: Callable[[F64], F64], reach: float, softness: float = 0.05) -> AnalyticMap:
    """Return the map of a body, seen from all sides, of a signed distance, positive within."""
    X = grid(-reach, reach)
    d = distance(X)
    inside = (d > 0) & (d < 0.1)
    return AnalyticMap(lambda X: distance(X) / softness, X[inside], X[(d < -0.05) & (d > -0.4)])


RADIUS, CENTRE = 0.6, np.array([0.013, -0.021, 0.008])


def ball(X: NDArray[np.floating]) -> F64:
    return np.asarray(RADIUS - np.linalg.norm(X - CENTRE, axis=1))


def box(X: NDArray[np.floating]) -> F64:
    return np.asarray((np.array([0.41, 0.33, 0.28]) - np.abs(X)).min(axis=1))
