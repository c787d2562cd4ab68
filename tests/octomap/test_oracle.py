"""Occupancy against OctoMap itself, on synthetic and on real clouds."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.cloud import LabelledCloud
from semgp.octomap import SemanticOctoMap, SensorModel
from semgp.readers import open_scans
from tests.octomap.oracle import CLASSES, assert_same_leaves, build, moved, oracle, pose, synthetic


def assert_same_map(
    clouds: Sequence[LabelledCloud], resolution: float, discretize: bool, max_range: float | None
) -> None:
    """Compare the pruned trees, the trees before pruning, and free, occupied and unknown space at points."""
    ours, theirs = build(clouds, resolution, max_range, discretize=discretize)
    assert_same_leaves(ours.leaves(), theirs, resolution)
    _, unpruned = build(clouds, resolution, max_range, discretize=discretize, lazy_eval=True)
    assert_same_leaves(ours.leaves(pruned=False), unpruned, resolution)
    points = ours.leaves().centres
    rng = np.random.default_rng(0)
    points = rng.uniform(points.min(axis=0) - 1, points.max(axis=0) + 1, (500, 3)).astype(np.float32).astype(float)
    for depth in (16, 15, 14, 12, 9, 4, 1):
        found = ours.query_occupancy(points, depth)
        nodes = [theirs.search(point, depth) for point in points]
        assert found.known.tolist() == [is_known(node) for node in nodes]
        known = [node for node in nodes if is_known(node)]
        np.testing.assert_allclose(found.log_odds[found.known], [node.getLogOdds() for node in known], rtol=1e-6)
        assert found.occupied[found.known].tolist() == [theirs.isNodeOccupied(node) for node in known]
    unknown = ours.unknown(points.min(axis=0), points.max(axis=0))
    for centre in unknown.centres[::25]:
        assert not is_known(theirs.search(centre))


def is_known(node: Any) -> bool:
    try:
        node.getLogOdds()
    except oracle.NullPointerException:
        return False
    return True


@pytest.mark.parametrize("discretize", [False, True])
@pytest.mark.parametrize("max_range", [None, 1.2])
class TestOccupancy:
    def test_synthetic_clouds(self, discretize: bool, max_range: float | None) -> None:
        assert_same_map([synthetic(seed) for seed in range(3)], 0.08, discretize, max_range)

    def test_depth_camera_frames(self, data_dir: Path, discretize: bool, max_range: float | None) -> None:
        frames = open_scans(data_dir / "nyu")
        clouds = [moved(frames[i][::300], pose(i)) for i in (0, 1, 1)]
        assert_same_map(clouds, 0.06, discretize, max_range)

    def test_lidar_scans(self, data_dir: Path, discretize: bool, max_range: float | None) -> None:
        scans = open_scans(data_dir / "semantickitti_08", world="camera")
        clouds = [scans[i][::150] for i in range(3)]
        assert_same_map(clouds, 0.5, discretize, max_range and 20 * max_range)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.02, 0.1, 0.25, 1 / 3, 1.0]),
    st.sampled_from([None, 0.8, 3.0]),
    st.booleans(),
    st.booleans(),
)
def test_rays_through_corners_and_along_borders(
    seed: int, resolution: float, max_range: float | None, discretize: bool, on_grid: bool
) -> None:
    """Ties: the traversal must break them as OctoMap does."""
    rng = np.random.default_rng(seed)
    ends = rng.integers(-15, 16, (13, 3)) * (resolution / 2 if on_grid else rng.uniform(0.3, 1) * resolution)
    T = np.eye(4)
    T[:3, 3] = ends[0]
    ours, theirs = build(
        [LabelledCloud(ends[1:].astype(np.float64), CLASSES, T_world_sensor=T)],
        resolution,
        None if max_range is None else max_range * resolution * 4,
        discretize=discretize,
    )
    assert_same_leaves(ours.leaves(), theirs, resolution)


def test_many_updates_clamp_alike() -> None:
    clouds = [synthetic(seed % 3, 300) for seed in range(12)]
    ours, theirs = build(clouds, 0.2)
    assert_same_leaves(ours.leaves(), theirs, 0.2)
    sensor = SensorModel()
    for name, value in (
        ("getProbHitLog", sensor.hit),
        ("getProbMissLog", sensor.miss),
        ("getClampingThresMinLog", sensor.clamp_min),
        ("getClampingThresMaxLog", sensor.clamp_max),
        ("getOccupancyThresLog", sensor.threshold),
    ):
        assert math.isclose(getattr(theirs, name)(), math.log(value / (1 - value)), abs_tol=1e-6)


def test_other_sensor_models() -> None:
    sensor = SensorModel(hit=0.9, miss=0.45, clamp_min=0.3, clamp_max=0.95, threshold=0.6)
    ours, theirs = SemanticOctoMap(CLASSES, 0.1, sensor=sensor), oracle.OcTree(0.1)
    theirs.setProbHit(0.9)
    theirs.setProbMiss(0.45)
    theirs.setClampingThresMin(0.3)
    theirs.setClampingThresMax(0.95)
    theirs.setOccupancyThres(0.6)
    for cloud in [synthetic(0), synthetic(1), synthetic(0), synthetic(2)]:
        ours.update(cloud)
        assert cloud.origin is not None
        theirs.insertPointCloud(cloud.points, cloud.origin.copy())
    assert_same_leaves(ours.leaves(), theirs, 0.1)
    occupied = [leaf.getCoordinate() for leaf in theirs.begin_leafs() if leaf.getOccupancy() >= 0.6]
    assert len(ours.occupied()) == len(occupied)
