"""Clouds of a few voxels, the Semantic OctoMap of them, and what is the same in two."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.octomap import SemanticOctoMap

CLASSES = Classes(("floor", "wall", "chair"))


def seen_from(origin: ArrayLike, points: ArrayLike, **fields: object) -> LabelledCloud:
    T_world_sensor = np.eye(4)
    T_world_sensor[:3, 3] = origin
    return LabelledCloud(
        np.asarray(points, dtype=float),
        CLASSES,
        T_world_sensor=T_world_sensor,
        **fields,  # type: ignore[arg-type]
    )


def random_cloud(seed: int, n: int = 400) -> LabelledCloud:
    rng = np.random.default_rng(seed)
    return seen_from(
        rng.uniform(-0.5, 0.5, 3),
        rng.uniform(-2, 2, (n, 3)),
        labels=rng.integers(-1, 3, n),
        colours=rng.integers(0, 256, (n, 3)),
    )


def built(*clouds: LabelledCloud, resolution: float = 0.1, **settings: object) -> SemanticOctoMap:
    octomap = SemanticOctoMap(CLASSES, resolution, **settings)  # type: ignore[arg-type]
    for cloud in clouds:
        octomap.update(cloud)
    return octomap


def voxels_of(points: NDArray[np.float64], resolution: float) -> list[tuple[int, ...]]:
    return [tuple(row) for row in np.floor(points.astype(np.float32) / resolution).astype(int).tolist()]


def assert_same(a: SemanticOctoMap, b: SemanticOctoMap) -> None:
    first, second = a.to_arrays(), b.to_arrays()
    assert first[0] == second[0]
    a_leaves, b_leaves = a.leaves(), b.leaves()
    np.testing.assert_array_equal(a_leaves.centres, b_leaves.centres)
    np.testing.assert_array_equal(a_leaves.log_odds, b_leaves.log_odds)
    for name in ("bricks", "known", "voxels", "voxel_classes", "colour_sums"):
        np.testing.assert_array_equal(first[1][name], second[1][name], err_msg=name)
    np.testing.assert_array_equal(a.query(a.positions).probability, b.query(a.positions).probability)
