"""A labelled cloud: what every reader gives and every map takes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING, Classes
from semgp.errors import InputError


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
    pixels : (N, 2) integer array, optional
        Row and column of each point in the image it came from.
    image_shape : (int, int), optional
        Rows and columns of that image.

    Raises
    ------
    InputError
        Lengths that differ, points or features that are not finite, labels out of range, a pose that is no
        rigid transform, or both hard and soft labels.
    """

    points: NDArray[np.float64]
    classes: Classes
    labels: NDArray[np.int32] | None = None
    weights: NDArray[np.floating[Any]] | None = None
    colours: NDArray[np.uint8] | None = None
    features: NDArray[np.floating[Any]] | None = None
    feature_names: tuple[str, ...] = ()
    T_world_sensor: NDArray[np.float64] | None = None
    pixels: NDArray[np.int32] | None = None
    image_shape: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        points = _array("points", self.points, np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError(f"points must have shape (N, 3), not {points.shape}.")
        _require_finite("points", points)
        n, c = len(points), len(self.classes)
        set_field = object.__setattr__
        set_field(self, "points", points)
        if self.labels is not None and self.weights is not None:
            raise InputError("give hard labels or soft weights, not both.")
        if self.labels is not None:
            set_field(self, "labels", _checked_labels(self.labels, n, c))
        if self.weights is not None:
            set_field(self, "weights", _checked_weights(self.weights, n, c))
        if self.colours is not None:
            set_field(self, "colours", _rows("colours", self.colours, n, 3, np.uint8))
        if self.features is not None:
            features = _rows("features", self.features, n, None, np.float32)
            _require_finite("features", features)
            set_field(self, "features", features)
            names = self.feature_names or tuple(f"feature {f}" for f in range(features.shape[1]))
            if len(names) != features.shape[1]:
                raise InputError(f"{features.shape[1]} features but {len(names)} feature names.")
            set_field(self, "feature_names", tuple(names))
        if self.T_world_sensor is not None:
            set_field(self, "T_world_sensor", rigid_transform("T_world_sensor", self.T_world_sensor))
        if self.pixels is not None:
            set_field(self, "pixels", _rows("pixels", self.pixels, n, 2, np.int32))

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
    def origin(self) -> NDArray[np.float64] | None:
        """Position (3,) of the sensor in the world, or None where the pose is not known."""
        return None if self.T_world_sensor is None else self.T_world_sensor[:3, 3]


def rigid_transform(name: str, T: ArrayLike) -> NDArray[np.float64]:
    """Check a rigid transform, shape (4, 4), and return it as float64.

    Raises
    ------
    InputError
        Wrong shape, entries that are not finite, or a rotation part that is not a rotation.
    """
    T = _array(name, T, np.float64)
    if T.shape != (4, 4):
        raise InputError(f"{name} must have shape (4, 4), not {T.shape}.")
    _require_finite(name, T)
    R = T[:3, :3]
    if (
        not np.allclose(R @ R.T, np.eye(3), atol=1e-3)
        or np.linalg.det(R) < 0
        or not np.allclose(T[3], (0, 0, 0, 1))
    ):
        raise InputError(f"{name} is no rigid transform: its last row must be 0 0 0 1, its 3 x 3 part a rotation.")
    return T


def _array(name: str, a: ArrayLike, dtype: type[np.generic]) -> NDArray[Any]:
    try:
        return np.ascontiguousarray(a, dtype=dtype)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers: {error}.") from error


def _rows(name: str, a: ArrayLike, n: int, width: int | None, dtype: type[np.generic]) -> NDArray[Any]:
    a = _array(name, a, dtype)
    if a.ndim != 2 or len(a) != n or (width is not None and a.shape[1] != width):
        raise InputError(f"{name} must have shape ({n}, {width or 'F'}) to go with {n} points, not {a.shape}.")
    return a


def _require_finite(name: str, a: NDArray[Any]) -> None:
    finite = np.isfinite(a).all(axis=tuple(range(1, a.ndim)))
    if not finite.all():
        raise InputError(
            f"{name} has NaN or infinite values in {np.count_nonzero(~finite)} of {len(a)} rows, "
            f"first in row {np.argmin(finite)}: drop them, for example with np.isfinite({name}).all(axis=1)."
        )


def _checked_labels(labels: ArrayLike, n: int, n_classes: int) -> NDArray[np.int32]:
    raw = np.asarray(labels)
    if raw.ndim != 1 or len(raw) != n:
        raise InputError(f"labels must have shape ({n},) to go with {n} points, not {raw.shape}.")
    if raw.dtype.kind not in "iub" and n:
        raise InputError(f"labels must be whole numbers, not {raw.dtype}; a missing label is {MISSING}.")
    if n and (raw.min() < MISSING or raw.max() >= n_classes):
        raise InputError(
            f"labels go from {raw.min()} to {raw.max()}, but with {n_classes} classes they must lie "
            f"between 0 and {n_classes - 1}, or be {MISSING} where missing."
        )
    return np.ascontiguousarray(raw, dtype=np.int32)


def _checked_weights(weights: ArrayLike, n: int, n_classes: int) -> NDArray[np.float32]:
    w = _rows("weights", weights, n, n_classes, np.float32)
    _require_finite("weights", w)
    if (w < 0).any():
        raise InputError("weights (soft labels) must not be negative.")
    return w
