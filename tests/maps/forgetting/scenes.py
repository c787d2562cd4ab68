"""A wall and a thing before it that comes and goes, and what maps of them hold."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.voxels import voxel_indices

F64 = NDArray[np.float64]

TWO = Classes(("wall", "thing"))
WALL, THING = 0, 1
EDGE = 0.1
MODEL = BlockModel(resolution=EDGE)
SENSOR = np.array([0.213, 3.027, 3.041])
THING_AT = SENSOR + np.array([1.52, 0, 0])
WALL_AT = SENSOR + np.array([3.03, 0, 0])
NEVER = Forgetting(1e12, passed=1.0)
QUICK = Forgetting(1000.0, passed=0.05)


def scan(
    thing_at: float | None = None, seed: int = 0, sensor: F64 = SENSOR, ahead: float = 1.52, **changed: Any
) -> LabelledCloud:
    """A wall 3 m ahead and, half way, a thing of 60 cm at a height, or nothing."""
    rng = np.random.default_rng(seed)
    d = np.column_stack([np.ones(2500), rng.uniform(-0.45, 0.45, (2500, 2))])
    t, labels = np.full(2500, 3.03), np.full(2500, WALL, np.int32)
    if thing_at is not None:
        on_thing = (np.abs(ahead * d[:, 1:] - (0, thing_at)) < 0.3).all(axis=1)
        t[on_thing], labels[on_thing] = ahead, THING
    T = np.eye(4)
    T[:3, 3] = sensor
    return replace(LabelledCloud(sensor + t[:, None] * d, TWO, labels, T_world_sensor=T), **changed)


def patch(at: ArrayLike, sensor: ArrayLike, n: int = 300, **changed: Any) -> LabelledCloud:
    """Some rays to a small patch."""
    T = np.eye(4)
    T[:3, 3] = sensor
    points = np.asarray(at) + np.random.default_rng(5).uniform(-0.25, 0.25, (n, 3))
    return replace(LabelledCloud(points, TWO, np.zeros(n, np.int32), T_world_sensor=T), **changed)


def new(forgetting: Forgetting | None, **free: Any) -> GPSemanticMap:
    return GPSemanticMap(TWO, MODEL, free=FreeSpace(**free), forgetting=forgetting)


def updated(made: GPSemanticMap, *clouds: LabelledCloud) -> GPSemanticMap:
    for cloud in clouds:
        made.update(cloud)
    return made


def masses(made: GPSemanticMap, prefix: str = "") -> dict[tuple[int, ...], list[int]]:
    """Class mass of each voxel of the world."""
    arrays = made.to_arrays()[1]
    index = voxel_indices(arrays[prefix + "voxels"], arrays[prefix + "origin"])
    return dict(zip(map(tuple, index.tolist()), arrays[prefix + "mass"].tolist()))


def off(at: F64, x: float, y: float, z: float) -> F64:
    return np.asarray(at + np.array([x, y, z]))


def near(points: F64, at: ArrayLike, reach: float = 0.4) -> NDArray[np.bool_]:
    return np.asarray((np.abs(points - np.asarray(at)) < reach).all(axis=1))


def square(at: F64) -> F64:
    """Points on a square of 40 cm."""
    y, z = np.meshgrid(*[np.linspace(-0.2, 0.2, 9)] * 2)
    return np.asarray(at + np.column_stack([np.zeros(81), y.ravel(), z.ravel()]))


def assert_same_masses(a: GPSemanticMap, b: GPSemanticMap) -> None:
    for prefix in ("", "free."):
        assert masses(a, prefix) == masses(b, prefix)
