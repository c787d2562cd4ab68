"""A labelled cloud: what every reader gives and every map takes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.checks import (
    as_array,
    as_rows,
    checked_confidence,
    checked_covariances,
    checked_labels,
    checked_weights,
    require_finite,
    rigid_transform,
)
from semgp.classes import MISSING, Classes
from semgp.errors import InputError
from semgp.upward import Up, vertical


@dataclass(frozen=True, eq=False)
class LabelledCloud:
    """Points in the world frame with class labels, most of which may be missing or wrong.

    Parameters
    ----------
    points : (N, 3) array
        Positions in metres, world frame; stored as float64, so that UTM coordinates keep their millimetres.
    classes : Classes
        The classes that the labels speak of.
    labels : (N,) integer array, optional
        Hard labels, 0 to C - 1; `MISSING` (-1) where the class is not known.
    weights : (N, C) array, optional
        Soft labels instead of hard ones: a non-negative weight for each class, for example the probabilities
        of a segmentation network. A row of zeros is a missing label.
    colours : (N, 3) uint8 array, optional
        Red, green, blue.
    features : (N, F) array, optional
        Further inputs of the map, such as intensity or normals.
    feature_names : tuple of str, optional
        One name a feature.
    T_world_sensor : (4, 4) array, optional
        Pose of the sensor (camera or lidar to world). Rays start at its origin.
    confidence : (N,) array, optional
        How much each label counts, from 0 (not at all) to 1; left out, all of them 1.
    covariances : (N, 3, 3) array, optional
        Covariance of each point's position, m^2, axes of the world, the pose taken as known: the sensor's noise.
    pose_covariance : (6, 6) array, optional
        Covariance of the pose: position (m) and small rotations about the sensor (rad), both along the axes of the
        world, in this order, as in ROS' PoseWithCovariance. Needs `T_world_sensor`.
    stamp : float, optional
        When the cloud was taken, seconds.
    pixels : (N, 2) integer array, optional
        Row and column of each point in the image it came from.
    image_shape : (int, int), optional
        Rows and columns of that image.
    up : str, optional
        The axis of the world that points upwards, see `semgp.upward`: "z", or "-y" in a camera's frame.

    Raises
    ------
    InputError
        Lengths that differ, points or features that are not finite, labels out of range, a pose that is no
        rigid transform, covariances that are none, no axis that is up, or both hard and soft labels.
    """

    points: NDArray[np.float64]
    classes: Classes
    labels: NDArray[np.int32] | None = None
    weights: NDArray[np.floating[Any]] | None = None
    colours: NDArray[np.uint8] | None = None
    features: NDArray[np.floating[Any]] | None = None
    feature_names: tuple[str, ...] = ()
    T_world_sensor: NDArray[np.float64] | None = None
    confidence: NDArray[np.float32] | None = None
    covariances: NDArray[np.float64] | None = None
    pose_covariance: NDArray[np.float64] | None = None
    stamp: float | None = None
    pixels: NDArray[np.int32] | None = None
    image_shape: tuple[int, int] | None = None
    up: Up = "z"

    def __post_init__(self) -> None:
        points = as_array("points", self.points, np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError(f"points must have shape (N, 3), not {points.shape}.")
        require_finite("points", points)
        n, c = len(points), len(self.classes)
        set_field = object.__setattr__
        set_field(self, "points", points)
        if self.labels is not None and self.weights is not None:
            raise InputError("give hard labels or soft weights, not both.")
        if self.labels is not None:
            set_field(self, "labels", checked_labels(self.labels, n, c))
        if self.weights is not None:
            set_field(self, "weights", checked_weights(self.weights, n, c))
        if self.colours is not None:
            set_field(self, "colours", as_rows("colours", self.colours, n, 3, np.uint8))
        if self.features is not None:
            features = as_rows("features", self.features, n, None, np.float32)
            require_finite("features", features)
            set_field(self, "features", features)
            names = self.feature_names or tuple(f"feature {f}" for f in range(features.shape[1]))
            if len(names) != features.shape[1]:
                raise InputError(f"{features.shape[1]} features but {len(names)} feature names.")
            set_field(self, "feature_names", tuple(names))
        if self.T_world_sensor is not None:
            set_field(self, "T_world_sensor", rigid_transform("T_world_sensor", self.T_world_sensor))
        if self.confidence is not None:
            set_field(self, "confidence", checked_confidence(self.confidence, n))
        if self.covariances is not None:
            set_field(self, "covariances", checked_covariances("covariances", self.covariances, (n, 3, 3)))
        if self.pose_covariance is not None:
            if self.T_world_sensor is None:
                raise InputError("a pose_covariance needs T_world_sensor, the pose that it is of.")
            set_field(
                self, "pose_covariance", checked_covariances("pose_covariance", self.pose_covariance, (6, 6))
            )
        if self.stamp is not None and not math.isfinite(self.stamp):
            raise InputError(f"stamp must be a time in seconds, not {self.stamp}.")
        if self.pixels is not None:
            set_field(self, "pixels", as_rows("pixels", self.pixels, n, 2, np.int32))
        vertical(self.up)

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, keep: slice | NDArray[Any]) -> LabelledCloud:
        """Return the cloud of the points that a mask, slice or index array selects."""

        def pick(a: Any) -> Any:
            return None if a is None else a[keep]

        return replace(
            self,
            points=self.points[keep],
            labels=pick(self.labels),
            weights=pick(self.weights),
            colours=pick(self.colours),
            features=pick(self.features),
            confidence=pick(self.confidence),
            covariances=pick(self.covariances),
            pixels=pick(self.pixels),
        )

    @property
    def labelled(self) -> NDArray[np.bool_]:
        """Mask (N,) of the points whose label, hard or soft, is present."""
        if self.labels is not None:
            return np.asarray(self.labels != MISSING)
        if self.weights is not None:
            return np.asarray(self.weights.sum(axis=1) > 0)
        return np.zeros(len(self), dtype=bool)

    @property
    def hard_labels(self) -> NDArray[np.int32]:
        """Labels (N,): the hard ones, or the class of most weight; `MISSING` where there is none."""
        if self.labels is not None:
            return self.labels
        if self.weights is None:
            return np.full(len(self), MISSING, dtype=np.int32)
        return np.where(self.labelled, self.weights.argmax(axis=1), MISSING).astype(np.int32)

    @property
    def class_weights(self) -> NDArray[np.float32]:
        """Class weights (N, C): the soft labels, or one in the column of the hard label; zeros where missing."""
        if self.weights is not None:
            return self.weights.astype(np.float32, copy=False)
        w = np.zeros((len(self), len(self.classes)), dtype=np.float32)
        rows = np.flatnonzero(self.labelled)
        w[rows, self.hard_labels[rows]] = 1
        return w

    @property
    def position_covariances(self) -> NDArray[np.float64] | None:
        """Covariances (N, 3, 3) of the positions, sensor noise and pose together; None where neither is known.

        To first order a point x moves by J (dt, dr), J = [I, -[x - t]_x], when a pose with position t moves by dt
        and turns about the world's axes by dr.
        """
        if self.pose_covariance is None or self.origin is None:
            return self.covariances
        x, y, z = (self.points - self.origin).T
        J = np.zeros((len(self), 3, 6))
        J[:, 0, 0] = J[:, 1, 1] = J[:, 2, 2] = 1
        J[:, 0, 4], J[:, 0, 5], J[:, 1, 3] = z, -y, -z
        J[:, 1, 5], J[:, 2, 3], J[:, 2, 4] = x, y, -x
        moved = J @ self.pose_covariance @ np.swapaxes(J, 1, 2)
        return moved if self.covariances is None else moved + self.covariances

    @property
    def origin(self) -> NDArray[np.float64] | None:
        """Position (3,) of the sensor in the world, or None where the pose is not known."""
        return None if self.T_world_sensor is None else self.T_world_sensor[:3, 3]
