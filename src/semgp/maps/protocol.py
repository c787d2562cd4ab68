"""What every map is: updated with clouds, queried at points, saved as plain arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.upward import Up


@runtime_checkable
class SemanticMap(Protocol):
    """A semantic map: the GP map, the OctoMap and the baselines alike."""

    kind: str
    """Name of the method in map files and on the command line, such as "gp" or "knn"."""

    classes: Classes

    @property
    def up(self) -> Up:
        """The axis of the world that points upwards, see `semgp.upward`: for pictures, no answer depends on it."""
        ...

    def update(self, cloud: LabelledCloud) -> None:
        """Take in a cloud, once for every scan. Never changes the map's settings."""
        ...

    def query(self, points: ArrayLike) -> Prediction:
        """Answer at points (M, 3), metres, world frame. The map must have been updated at least once."""
        ...

    @property
    def positions(self) -> NDArray[np.float64]:
        """Where the map has data, (n, 3), metres, world frame: points, sites or voxel centres."""
        ...

    def __len__(self) -> int:
        """Return the number of stored elements: training points, sites or voxels."""
        ...

    def info(self) -> dict[str, Any]:
        """Return settings, counts and memory figures, ready for JSON."""
        ...


@runtime_checkable
class SerialisableMap(SemanticMap, Protocol):
    """A semantic map that is plain arrays: what map files hold."""

    up: Up
    """As in `SemanticMap`: "z" unless it is set, to that of the clouds."""

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return a header ready for JSON and plain arrays from which `from_arrays` makes the same map."""
        ...

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the map again from what `to_arrays` gave."""
        ...


@runtime_checkable
class SpatialMap(SemanticMap, Protocol):
    """A semantic map that keeps free space, too: its predictions have an `occupancy`.

    What planners need: see `semgp.planning`.
    """

    def occupancy(self, points: ArrayLike) -> OccupancyPrediction:
        """Return what `query` says of occupancy at points (M, 3), without the classes: cheaper."""
        ...

    @property
    def resolution(self) -> float:
        """Edge in metres of the voxels in which the map collects its data: what it tells apart."""
        ...

    @property
    def occupied_positions(self) -> NDArray[np.float64]:
        """Where rays ended, (n, 3), metres, world frame: sites or voxel centres."""
        ...

    @property
    def free_positions(self) -> NDArray[np.float64]:
        """Where rays passed, (n, 3), metres, world frame: sites or voxel centres."""
        ...


BATCH = 1 << 17
"""Points that planners and surfaces ask a map about at once: bounds the memory."""

NO_FREE_SPACE = (
    "the map keeps no free space, and says nowhere that nothing is there: make a GPSemanticMap(..., "
    "free=FreeSpace()) or a SemanticOctoMap, and update it with clouds that have a T_world_sensor."
)


def occupancy_of(prediction: Prediction) -> OccupancyPrediction:
    """Return whether something is there.

    Raises
    ------
    InputError
        The prediction of a map that keeps no free space.
    """
    if prediction.occupancy is None:
        raise InputError(NO_FREE_SPACE)
    return prediction.occupancy


def require_classes(cloud: LabelledCloud, classes: Classes) -> None:
    """Check that a cloud's labels speak of a map's classes.

    Raises
    ------
    InputError
        Classes that differ from the map's.
    """
    if cloud.classes.names != classes.names:
        raise InputError(
            f"the cloud's classes ({', '.join(cloud.classes.names)}) are not the map's "
            f"({', '.join(classes.names)}): give the cloud the map's classes."
        )


def training_part(cloud: LabelledCloud, classes: Classes) -> LabelledCloud:
    """Return the labelled points of a cloud, checked against a map's classes.

    Raises
    ------
    InputError
        Classes that differ from the map's.
    """
    require_classes(cloud, classes)
    return cloud[cloud.labelled]


def query_points(points: ArrayLike) -> NDArray[np.float64]:
    """Check query points and return them as float64, shape (M, 3).

    Raises
    ------
    InputError
        Wrong shape, or NaN or infinite coordinates.
    """
    X = np.ascontiguousarray(points, dtype=np.float64)
    if X.ndim != 2 or X.shape[1] != 3:
        raise InputError(f"query points must have shape (M, 3), not {X.shape}.")
    finite = np.isfinite(X).all(axis=1)
    if not finite.all():
        raise InputError(f"{np.count_nonzero(~finite)} of {len(X)} query points are NaN or infinite: drop them.")
    return X
