"""OctoMap itself (octomap-python) beside the Semantic OctoMap of the same clouds."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.octomap import Cells, SemanticOctoMap

oracle: Any = pytest.importorskip("octomap", reason="octomap-python is not installed")

CLASSES = Classes(("floor", "wall", "chair"))


def pose(seed: int, reach: float = 0.5) -> NDArray[np.float64]:
    """Return any rigid transform."""
    rng = np.random.default_rng(seed)
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    T = np.eye(4)
    T[:3, :3] = Q * np.linalg.det(Q)
    T[:3, 3] = rng.uniform(-reach, reach, 3)
    return T


def moved(cloud: LabelledCloud, T: NDArray[np.float64]) -> LabelledCloud:
    return replace(cloud, points=cloud.points @ T[:3, :3].T + T[:3, 3], T_world_sensor=T)


def synthetic(seed: int, n: int = 1500) -> LabelledCloud:
    """Return points on the walls of a box around the sensor, and some inside it."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(n, 3))
    points = directions / np.abs(directions).max(axis=1, keepdims=True) * rng.choice([0.7, 1.3, 1.7], (n, 1))
    labels = rng.integers(-1, 3, n, dtype=np.int32)
    colours = rng.integers(0, 255, (n, 3), dtype=np.uint8)
    return moved(LabelledCloud(points, CLASSES, labels, colours=colours), pose(seed))


def build(
    clouds: Sequence[LabelledCloud], resolution: float, max_range: float | None = None, **options: bool
) -> tuple[SemanticOctoMap, Any]:
    """Return both maps of the same clouds; `lazy_eval` keeps the oracle from pruning."""
    discretize, lazy_eval = options.get("discretize", False), options.get("lazy_eval", False)
    ours = SemanticOctoMap(clouds[0].classes, resolution, max_range=max_range, discretize=discretize)
    theirs = oracle.OcTree(resolution)
    for cloud in clouds:
        ours.update(cloud)
        assert cloud.origin is not None
        theirs.insertPointCloud(
            cloud.points, cloud.origin.copy(), max_range or -1.0, lazy_eval=lazy_eval, discretize=discretize
        )
    if lazy_eval:
        theirs.updateInnerOccupancy()
    return ours, theirs


def rows_of(tree: Any, resolution: float) -> NDArray[np.float64]:
    """Return the oracle's leaves in order: centres and sizes in half voxels, and log-odds."""
    rows = [
        (*np.rint(leaf.getCoordinate() / resolution * 2), round(leaf.getSize() / resolution), leaf.getValue())
        for leaf in tree.begin_leafs()
    ]
    return in_order(np.array(rows).reshape(-1, 5))


def rows_of_cells(cells: Cells, resolution: float) -> NDArray[np.float64]:
    return in_order(
        np.column_stack(
            [np.rint(cells.centres / resolution * 2), np.rint(cells.sizes / resolution), cells.log_odds]
        )
    )


def in_order(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    return rows[np.lexsort(rows.T[:4])]


def assert_same_leaves(cells: Cells, tree: Any, resolution: float) -> None:
    ours, theirs = rows_of_cells(cells, resolution), rows_of(tree, resolution)
    np.testing.assert_array_equal(ours[:, :4], theirs[:, :4])
    np.testing.assert_allclose(ours[:, 4], theirs[:, 4], rtol=1e-6, atol=1e-6)
