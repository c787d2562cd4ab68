"""Maps to be fused, and what their voxels hold as dictionaries of whole numbers."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgp.blocks.accumulate import FEATURE_UNIT, PLACE_UNIT
from semgp.blocks.merging import Sums, stored_sums
from semgp.blocks.model import BlockModel
from semgp.cloud import LabelledCloud
from semgp.maps.free_space import FreeSpace, occupancy_model
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.prediction import Prediction

FREE = FreeSpace(occupancy_model(OUTDOOR_LIDAR.resolution, vertical=2), rays=2000)
SMALL = BlockModel(resolution=0.1)
Array = NDArray[np.float64]
Voxels = dict[tuple[int, ...], list[list[int]]]


def built(
    scans: Iterable[LabelledCloud], model: BlockModel = OUTDOOR_LIDAR, free: FreeSpace | None = None
) -> GPSemanticMap:
    scans = list(scans)
    gp_map = GPSemanticMap(scans[0].classes, model, free=free)
    for scan in scans:
        gp_map.update(scan)
    return gp_map


def transform(degrees: float = 0.0, t: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0, 0, np.radians(degrees)]).as_matrix()
    T[:3, 3] = t
    return T


def in_frame(scan: LabelledCloud, T_a_b: Array) -> LabelledCloud:
    T = np.linalg.inv(T_a_b)
    sensor = None if scan.T_world_sensor is None else T @ scan.T_world_sensor
    return replace(scan, points=scan.points @ T[:3, :3].T + T[:3, 3], T_world_sensor=sensor)


def voxels(arrays: Mapping[str, NDArray[Any]], prefix: str = "") -> Voxels:
    """What each voxel of the world holds, in whole numbers of any size."""
    sums = stored_sums(arrays, prefix)
    spread = sums.spread if len(sums.spread) else np.zeros((len(sums.mass), 4), np.int64)
    rows = zip(sums.voxels.tolist(), sums.mass.tolist(), sums.place.tolist(), spread.tolist())
    return {tuple(v): [mass, place, variances] for v, mass, place, variances in rows}


def held(gp_map: GPSemanticMap) -> dict[str, Voxels]:
    arrays = gp_map.to_arrays()[1]
    return {prefix: voxels(arrays, prefix) for prefix in ("", "free.") if prefix + "voxels" in arrays}


def added(parts: Iterable[Voxels]) -> Voxels:
    total: Voxels = {}
    for part in parts:
        for key, (mass, place, spread) in part.items():
            if key in total:
                m, p, s = total[key]
                draws = s[3] | spread[3]
                mass, place = [x + y for x, y in zip(m, mass)], [x + y for x, y in zip(p, place)]
                spread = [*(x + y for x, y in zip(s[:3], spread[:3])), draws]
            total[key] = [mass, place, spread]
    return total


def assert_same_answers(a: GPSemanticMap, b: GPSemanticMap, points: Array) -> None:
    x, y = a.query(points), b.query(points)
    np.testing.assert_allclose(x.probability, y.probability, atol=1e-6)
    np.testing.assert_allclose(cast("Array", x.variance), cast("Array", y.variance), atol=1e-6)
    np.testing.assert_array_equal(x.observed, y.observed)
    assert (x.occupancy is None) == (y.occupancy is None)
    if x.occupancy is not None and y.occupancy is not None:
        np.testing.assert_allclose(x.occupancy.probability, y.occupancy.probability, atol=1e-6)
        np.testing.assert_array_equal(x.occupancy.known, y.occupancy.known)


def difference(a: Prediction, b: Prediction) -> float:
    return float(np.abs(a.probability - b.probability).sum(axis=1).mean())


def random_sums(rng: np.random.Generator, n: int, uncertain: bool) -> Sums:
    voxels = rng.integers(-3, 3, (n, 3)) + rng.integers(-90, 90, 3)
    mass = rng.integers(1, rng.choice([5, 2**31]), (n, 2)).astype(np.uint32)
    total = mass.sum(axis=1, dtype=np.int64)[:, None]
    place = (total * rng.integers(0, PLACE_UNIT, (n, 4))).astype(np.int64)
    spread = np.hstack([rng.integers(0, 2**50, (n, 3)), rng.integers(0, 2**48, (n, 1))])
    return Sums(voxels, mass, place, spread[: n if uncertain else 0], np.zeros(3, np.int64))


def at_most(mass: int, voxel: tuple[int, int, int] = (0, 0, 0)) -> Sums:
    """A site with as large a feature as may be."""
    place = np.array([[mass * PLACE_UNIT] * 3 + [mass * 30_000 * FEATURE_UNIT]])
    spread, origin = np.zeros((0, 4), np.int64), np.zeros(3, np.int64)
    return Sums(np.array([voxel]), np.array([[mass]], np.uint32), place, spread, origin)
