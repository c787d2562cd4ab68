"""A map whose answers are known exactly: boxes with soft faces, seen in a part of space."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.scene.raycast import BOX, Solids
from semgp.upward import Up

F64 = NDArray[np.float64]


class BoxWorld:
    """Boxes (B, 6), low and high corners, with labels (B,); occupancy is a sigmoid of the distance to their faces.

    What lies outside of the `seen` box (6,) is unknown, and answered with a prior of one half.
    """

    kind = "boxes"
    up: Up = "z"

    def __init__(
        self,
        classes: Classes,
        boxes: ArrayLike,
        labels: ArrayLike,
        seen: ArrayLike,
        resolution: float = 0.1,
        softness: float = 0.01,
    ) -> None:
        self.classes = classes
        self.boxes, self.labels = np.array(boxes, dtype=np.float64), np.array(labels)
        self.seen = np.array(seen, dtype=np.float64)
        self._middle, self._half = (self.seen[3:] + self.seen[:3]) / 2, (self.seen[3:] - self.seen[:3]) / 2
        self.resolution, self.softness = resolution, softness
        self.asked: list[int] = []

    def distances(self, X: F64) -> F64:
        """Signed distances (M, B) to the boxes, negative inside."""
        low, high = self.boxes[:, :3], self.boxes[:, 3:]
        beyond = np.maximum(low - X[:, None], X[:, None] - high)
        outside = np.linalg.norm(np.maximum(beyond, 0), axis=2)
        return np.asarray(outside + np.minimum(beyond.max(axis=2), 0))

    def query(self, points: ArrayLike) -> Prediction:
        X = np.asarray(points, dtype=np.float64)
        self.asked.append(len(X))
        distances = self.distances(X)
        nearest, distance = distances.argmin(axis=1), distances.min(axis=1)
        known = np.asarray((np.abs(X - self._middle) <= self._half).all(axis=1))
        C = len(self.classes)
        probability = np.full((len(X), C), 0.3 / (C - 1))
        probability[np.arange(len(X)), self.labels[nearest]] = 0.7
        occupancy = OccupancyPrediction(np.where(known, expit(-distance / self.softness), 0.5), known)
        return Prediction(self.classes, probability, known & (distance < 0.3), occupancy=occupancy)

    def occupancy(self, points: ArrayLike) -> OccupancyPrediction:
        occupancy = self.query(points).occupancy
        assert occupancy is not None
        return occupancy

    @property
    def occupied_positions(self) -> F64:
        return self._centres(occupied=True)

    @property
    def free_positions(self) -> F64:
        return self._centres(occupied=False)

    @property
    def positions(self) -> F64:
        return self.occupied_positions

    def solids(self) -> Solids:
        """The boxes, for exact ray casting."""
        low, high = self.boxes[:, :3], self.boxes[:, 3:]
        n = len(self.boxes)
        return Solids(np.full(n, BOX), (low + high) / 2, (high - low) / 2, np.zeros(n))

    def _centres(self, occupied: bool) -> F64:
        """Centres of the voxels in the seen box whose middle is occupied or free."""
        axes = [np.arange(a, b, self.resolution) + self.resolution / 2 for a, b in self.seen.reshape(2, 3).T]
        centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        return np.asarray(centres[(self.distances(centres).min(axis=1) < 0) == occupied])

    def update(self, cloud: LabelledCloud) -> None:
        raise NotImplementedError

    def __len__(self) -> int:
        return len(self.boxes)

    def info(self) -> dict[str, Any]:
        return {}

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        raise NotImplementedError

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        raise NotImplementedError


FLOOR, WALL, TABLE = range(3)
CLASSES = Classes(("floor", "wall", "table"))


def room(offset: ArrayLike = (0.0, 0.0, 0.0), **settings: Any) -> BoxWorld:
    """A room of 4 m x 3 m without a ceiling, with a table that one can look under; the last 80 cm are unknown."""
    boxes = [
        (-0.2, -0.2, -0.2, 4.2, 3.2, 0.0),  # floor
        (-0.2, -0.2, 0.0, 0.0, 3.2, 2.0),  # walls
        (4.0, -0.2, 0.0, 4.2, 3.2, 2.0),
        (0.0, -0.2, 0.0, 4.0, 0.0, 2.0),
        (0.0, 3.0, 0.0, 4.0, 3.2, 2.0),
        (1.5, 1.0, 0.6, 2.5, 2.0, 0.8),  # table top
        (1.9, 1.4, 0.0, 2.1, 1.6, 0.6),  # its leg
    ]
    seen = (-0.2, -0.2, -0.2, 3.2, 3.2, 2.0)
    six = np.tile(np.asarray(offset), 2)
    labels = [FLOOR, WALL, WALL, WALL, WALL, TABLE, TABLE]
    return BoxWorld(CLASSES, np.array(boxes) + six, labels, np.array(seen) + six, **settings)
