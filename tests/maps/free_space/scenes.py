"""A room of six faces seen from inside, its maps, and what these hold."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.blocks.model import BlockModel
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.voxels import voxel_indices

F64 = NDArray[np.float64]

SIX = Classes(("west", "east", "south", "north", "floor", "ceiling"))
LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([5.0, 4.0, 2.5])
EDGE = 0.1
MODEL = BlockModel(resolution=EDGE)
FREE_SPACE = FreeSpace()


def pose(at: ArrayLike) -> F64:
    T = np.eye(4)
    T[:3, 3] = at
    return T


def scan(at: ArrayLike, seed: int, n: int = 800, **changed: Any) -> LabelledCloud:
    """A scan of a room from inside, in all directions; each face is a class, one label in three is missing."""
    rng = np.random.default_rng(seed)
    d, sensor = rng.normal(size=(n, 3)), np.asarray(at)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    to_faces = np.where(d < 0, LOW - sensor, HIGH - sensor) / d
    axis = to_faces.argmin(axis=1)
    points = sensor + d * (to_faces.min(axis=1) + rng.normal(scale=0.01, size=n))[:, None]
    labels = np.where(
        rng.random(n) < 1 / 3, MISSING, 2 * axis + (np.take_along_axis(d, axis[:, None], 1)[:, 0] > 0)
    )
    return replace(LabelledCloud(points, SIX, labels, T_world_sensor=pose(sensor)), **changed)


def moved(cloud: LabelledCloud, by: ArrayLike) -> LabelledCloud:
    assert cloud.origin is not None
    return replace(cloud, points=cloud.points + np.asarray(by), T_world_sensor=pose(cloud.origin + np.asarray(by)))


PLACES = ((1.31, 1.17, 1.23), (3.72, 2.61, 1.34), (2.53, 3.18, 0.71), (4.12, 0.94, 1.92))


def room() -> list[LabelledCloud]:
    return [scan(at, seed) for seed, at in enumerate(PLACES)]


def built(
    clouds: list[LabelledCloud], free: FreeSpace | None = FREE_SPACE, model: BlockModel = MODEL
) -> GPSemanticMap:
    made = GPSemanticMap(clouds[0].classes, model, free=free)
    for cloud in clouds:
        made.update(cloud)
    return made


def queries(n: int = 4000) -> F64:
    return np.random.default_rng(99).uniform(LOW - 0.8, HIGH + 0.8, (n, 3))


def occupancy_of(prediction: Prediction) -> OccupancyPrediction:
    assert prediction.occupancy is not None
    return prediction.occupancy


def sites_of(made: GPSemanticMap) -> dict[str, NDArray[Any]]:
    """All sites of both fields in the order of their voxels of the world."""
    arrays, found = made.to_arrays()[1], {}
    for prefix in ("", "free.") if made.free else ("",):
        index = voxel_indices(arrays[prefix + "voxels"], arrays[prefix + "origin"])
        order = np.lexsort(index.T)
        found[prefix + "index"] = index[order]
        for name in ("mass", "place"):
            found[prefix + name] = arrays[prefix + name][order]
    return found


def assert_same_sites(a: Mapping[str, NDArray[Any]], b: Mapping[str, NDArray[Any]]) -> None:
    assert a.keys() == b.keys()
    for name in a:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def assert_same(a: GPSemanticMap, b: GPSemanticMap, asked: F64 | None = None) -> None:
    """To the last bit: sites and answers."""
    assert_same_sites(sites_of(a), sites_of(b))
    X = queries() if asked is None else asked
    mine, other = a.query(X), b.query(X)
    np.testing.assert_array_equal(mine.probability, other.probability)
    np.testing.assert_array_equal(mine.variance, other.variance)
    np.testing.assert_array_equal(occupancy_of(mine).probability, occupancy_of(other).probability)
    np.testing.assert_array_equal(occupancy_of(mine).known, occupancy_of(other).known)
