"""Maps as bags: what they say at points, and their OctoMap where they have one."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.errors import InputError
from semgp.logs.recording import recording
from semgp.prediction import Prediction


class Answering(Protocol):
    """What any semantic map can do; see `semgp.maps.protocol.SemanticMap`."""

    @property
    def positions(self) -> NDArray[np.float64]:
        """Where the map has data, (n, 3), metres."""
        ...

    def query(self, points: ArrayLike) -> Prediction:
        """Answer at points (M, 3)."""
        ...


@runtime_checkable
class HasOctree(Protocol):
    """A map that OctoMap can read; see `semgp.octomap.SemanticOctoMap`."""

    origin: NDArray[np.float64]

    def write(self, path: str | Path, colours: Any = None) -> None:
        """Write the map as a file of OctoMap."""
        ...


def write_map(
    path: str | Path,
    semantic_map: Answering,
    points: ArrayLike | None = None,
    octomap: HasOctree | None = None,
    **options: Any,
) -> Prediction:
    """Write what a map says as a bag that RViz and other tools of ROS open, and return it.

    The bag has /semantic_map, a PointCloud2 (see `prediction_columns` for its fields), /label_info, a
    vision_msgs/LabelInfo with the names of the classes, and for a semantic OctoMap /octomap, an
    octomap_msgs/Octomap.

    Parameters
    ----------
    path : str or Path
        The bag; see `recording`.
    semantic_map : SemanticMap
        The map.
    points : (M, 3) array, optional
        Where to ask it, such as a `surface_grid`; left out, where it has data.
    octomap : SemanticOctoMap, optional
        Its OctoMap, such as `semgp.maps.octree.to_octomap` makes; left out, the map itself if it is one.
    **options
        See `recording`.

    Raises
    ------
    InputError
        An empty map, points that are not (M, 3) and finite, or what `recording` refuses.
    """
    X = np.asarray(semantic_map.positions if points is None else points, dtype=np.float64)
    if not len(X):
        raise InputError("there are no points to ask the map about: it is empty, or none were given.")
    prediction = semantic_map.query(X)
    if octomap is None and isinstance(semantic_map, HasOctree):
        octomap = semantic_map
    with recording(path, **options) as bag:
        bag.prediction(X, prediction)
        if octomap is not None:
            bag.octomap(tree_of(octomap), octomap.origin)
    return prediction


def tree_of(semantic_map: HasOctree) -> bytes:
    """Return the content of the `.bt` file of a map: free or occupied, pruned."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "map.bt"
        semantic_map.write(path)
        return path.read_bytes()
