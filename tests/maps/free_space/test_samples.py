"""What one cloud tells of free space: at most one thing of each voxel."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.accumulate import MASS_UNIT
from semgp.blocks.cells import cell_origin
from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.maps.free_space import FreeSpace
from semgp.maps.occupancy import Occupancy, Rays
from semgp.maps.rays import Walk, free_samples
from semgp.prediction import FREE, OCCUPIED
from semgp.voxels import VoxelTable
from tests.maps.free_space.scenes import EDGE, SIX, assert_same, built, pose, room, sites_of

F64 = NDArray[np.float64]


class TestSamples:
    """What one cloud tells: at most one thing of each voxel."""

    def floor(self) -> LabelledCloud:
        """Rays that graze the floor: many pass where others end."""
        rng = np.random.default_rng(0)
        points = np.column_stack([rng.uniform(-4, 4, (3000, 2)), rng.normal(0.05, 0.02, 3000)])
        return LabelledCloud(points, SIX, np.full(3000, 4), T_world_sensor=pose((0.03, 0.02, 0.8)))

    def sampled(self, cloud: LabelledCloud, **settings: Any) -> Rays:
        space = Occupancy(FreeSpace(**settings).of_resolution(EDGE))
        return space.sample(cloud, cell_origin(cloud.points, EDGE), np.empty(0, dtype=bool))

    def voxels(self, points: F64) -> set[tuple[int, ...]]:
        return set(map(tuple, np.floor(points / EDGE).astype(int).tolist()))

    @pytest.mark.parametrize(
        "settings",
        [
            {"thin": 1},
            {"thin": 8, "near": 2.0},
            {"thin": 1, "rays": 900, "seed": 3, "margin": 1.7},
            {"reach": 2.0},
        ],
        ids=str,
    )
    def test_each_voxel_once_and_ends_before_passages(self, settings: dict[str, Any]) -> None:
        cloud, free = self.floor(), FreeSpace(**settings)
        rays = self.sampled(cloud, **settings)
        reach = np.inf if free.reach is None else free.reach
        walk = Walk(
            EDGE, np.zeros(3), free.rays / 3000, free.seed, free.margin * EDGE, free.near * EDGE, free.thin, reach
        )
        assert cloud.origin is not None
        passed, _, _ = free_samples(cloud.origin, cloud.points, walk, VoxelTable(), np.empty(0, dtype=bool))
        ended = cloud.points[np.linalg.norm(cloud.points - cloud.origin, axis=1) <= reach]
        hit = rays.labels == OCCUPIED
        assert set(rays.labels.tolist()) == {FREE, OCCUPIED}
        assert len(self.voxels(passed) & self.voxels(ended)) > 20
        assert self.voxels(rays.points[hit]) == self.voxels(ended)
        assert self.voxels(rays.points[~hit]) == self.voxels(passed) - self.voxels(ended)
        assert len(self.voxels(rays.points)) == len(rays.points)
        assert set(map(tuple, rays.points[hit].tolist())) <= set(map(tuple, ended.tolist()))
        assert set(map(tuple, rays.points[~hit].tolist())) <= set(map(tuple, passed.tolist()))
        assert len(rays.passed) == 0

    def test_a_ray_along_nothing_but_ends_frees_nothing(self) -> None:
        ends = np.column_stack([np.arange(3.0, 0.0, -0.05), np.full((60, 2), 0.05)])
        rays = self.sampled(LabelledCloud(ends, SIX, T_world_sensor=pose((0.01, 0.05, 0.05))), thin=1)
        assert len(rays.points) > 25
        assert (rays.labels == OCCUPIED).all()

    def test_beyond_its_reach_a_ray_only_passes(self) -> None:
        ends = np.array([[1.55, 0.05, 0.05], [9.05, 0.05, 3.05]])
        cloud = LabelledCloud(ends, SIX, T_world_sensor=pose((0.05, 0.05, 0.05)))
        rays = self.sampled(cloud, reach=4.0, thin=1)
        t = np.linalg.norm(rays.points - 0.05, axis=1)
        assert rays.points[rays.labels == OCCUPIED].tolist() == ends[:1].tolist()
        aside = t[rays.points[:, 2] > 0.1 + 0.1 * t]
        assert 3.9 < aside.max() <= 4.0
        assert len(aside) > 30
        assert (t <= 4.0).all()

    def test_a_point_at_its_reach_is_an_end(self) -> None:
        cloud = LabelledCloud(np.array([[4.0, 0.0, 0.0]]), SIX, T_world_sensor=np.eye(4))
        assert OCCUPIED in self.sampled(cloud, reach=4.0).labels
        assert OCCUPIED not in self.sampled(cloud, reach=np.nextafter(4.0, 0)).labels

    def test_ends_need_no_labels(self) -> None:
        cloud = self.floor()
        with_labels = self.sampled(cloud)
        for unlabelled in (
            replace(cloud, labels=None),
            replace(cloud, labels=np.full(3000, MISSING, np.int32)),
            replace(cloud, confidence=np.zeros(3000, np.float32)),
        ):
            rays = self.sampled(unlabelled)
            np.testing.assert_array_equal(rays.points, with_labels.points)
            np.testing.assert_array_equal(rays.labels, with_labels.labels)

    def test_the_number_of_rays_bounds_the_cost(self) -> None:
        """A tenth of the rays: all ends, and a tenth of the samples near them."""
        cloud = self.floor()
        settings = {"margin": 0.1, "near": 1.5, "thin": 2**30}  # one or two samples a ray, before its end
        every, some = (self.sampled(cloud, rays=rays, **settings) for rays in (3000, 300))
        free, some_free = (np.count_nonzero(rays.labels == FREE) for rays in (every, some))
        assert (every.labels == OCCUPIED).sum() == (some.labels == OCCUPIED).sum()
        assert 0 < some_free < 2 * (300 + 5 * np.sqrt(300)) < free

    @pytest.mark.parametrize("weight", [0.25, 0.5, 2.0])
    def test_what_a_scan_counts(self, weight: float) -> None:
        cloud = self.floor()
        once, twice = (sites_of(built([cloud] * n, FreeSpace(weight=weight))) for n in (1, 2))
        mass = once["free.mass"].tolist()
        steps = int(weight * MASS_UNIT)
        assert sorted({tuple(m) for m in mass}) == sorted([(0, MASS_UNIT), (steps, 0)])
        np.testing.assert_array_equal(twice["free.mass"], 2 * once["free.mass"])
        np.testing.assert_array_equal(twice["free.place"], 2 * once["free.place"])

    def test_the_order_of_points_decides_no_voxel(self) -> None:
        cloud = self.floor()
        a, b = (sites_of(built([c])) for c in (cloud, cloud[::-1]))
        np.testing.assert_array_equal(a["free.index"], b["free.index"])
        np.testing.assert_array_equal(a["free.mass"], b["free.mass"])


def test_the_reach_may_be_a_whole_number() -> None:
    assert_same(built(room()[:1], FreeSpace(reach=2)), built(room()[:1], FreeSpace(reach=2.0)))
