"""Samples along rays, against a walk along each of them in plain Python."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from semgp.blocks.cells import CELL
from semgp.maps import rays
from semgp.maps.rays import Walk, free_samples
from semgp.voxels import VoxelTable, voxel_indices, voxel_keys

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

EDGE = 0.1
NONE = 2**30
"""So thin that no sample counts for its voxel alone."""


def walk(**changed: Any) -> Walk:
    plain: dict[str, Any] = {
        "resolution": EDGE, "origin": np.zeros(3), "share": 1.0, "seed": 0, "margin": EDGE, "near": 3 * EDGE,
        "thin": 1, "reach": np.inf,
    }  # fmt: skip
    return Walk(**(plain | changed))


def sampled(sensor: F64, points: F64, settings: Walk) -> tuple[F64, I64]:
    samples, keys, passed = free_samples(sensor, points, settings, VoxelTable(), np.empty(0, dtype=bool))
    assert len(passed) == 0
    return samples, keys


def world(keys: I64, settings: Walk) -> I64:
    """Voxels (n, 3) counted from the origin of the world."""
    return voxel_indices(keys, settings.origin.astype(np.int64))


def around(sensor: F64, n: int, seed: int, shortest: float = 0.05, longest: float = 6.0) -> F64:
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(n, 3))
    return np.asarray(
        sensor + d / np.linalg.norm(d, axis=1, keepdims=True) * rng.uniform(shortest, longest, (n, 1))
    )


def phases(sensor: F64, points: F64, seed: int) -> F64:
    """By which share of a voxel the first sample of each ray lies nearer to the sensor than it could."""
    step = 0.02
    reach = step * (2 - 1e-6)  # exactly one sample a ray fits in
    samples, _ = sampled(sensor, points, walk(resolution=step, margin=0.0, reach=reach, seed=seed))
    assert len(samples) == len(points)
    return np.asarray((reach - np.linalg.norm(samples - sensor, axis=1)) / step)


def naive_walk(sensor: F64, points: F64, settings: Walk) -> tuple[F64, Bool]:
    """All samples (n, 3) along rays, whatever their voxel, and which lie near the ends of theirs."""
    samples, near = [], []
    for point, phase in zip(points, phases(sensor, points, settings.seed)):
        length = math.dist(sensor, point)
        t = min(length - settings.margin, settings.reach) - phase * settings.resolution
        while t >= settings.resolution and length >= settings.resolution:
            samples.append(sensor + t / length * (point - sensor))
            near.append(t > length - settings.near)
            t -= settings.resolution
    return np.array(samples).reshape(-1, 3), np.array(near, dtype=bool)


def off_faces(samples: F64, resolution: float) -> Bool:
    """Samples that lie so deep in their voxels that rounding does not matter."""
    inside = samples / resolution - np.floor(samples / resolution)
    return np.asarray((np.abs(inside - 0.5) < 0.5 - 1e-5).all(axis=1))


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.0, -3.0, 5e6]),
    st.sampled_from([0.05, 0.2, 1 / 3]),
    st.sampled_from([0.3, 1.0, 2.5]),
    st.sampled_from([np.inf, 2.0, 0.4]),
    st.sampled_from([1, NONE]),
)
@settings(deadline=None, max_examples=40)
def test_a_ray_is_sampled_once_a_voxel(
    seed: int, shift: float, resolution: float, margin: float, reach: float, thin: int
) -> None:
    rng = np.random.default_rng(seed)
    sensor = rng.uniform(-1, 1, 3) + shift * np.array([1.0, -1.0, 0.5])
    points = around(sensor, 40, seed)
    w = walk(
        resolution=resolution, origin=np.floor(sensor / resolution) + rng.integers(-900, 900, 3), seed=seed,
        margin=margin * resolution, near=3.3 * resolution, thin=thin, reach=reach,
    )  # fmt: skip
    expected, near = naive_walk(sensor, points, w)
    expected = expected if thin == 1 else expected[near]
    samples, keys = sampled(sensor, points, w)
    np.testing.assert_allclose(samples, expected, rtol=0, atol=1e-7)
    inner = off_faces(samples, resolution)
    np.testing.assert_array_equal(world(keys, w)[inner], np.floor(samples / resolution)[inner])


def test_where_samples_may_lie() -> None:
    """Said once more without a phase: never beyond the margin or the reach, the first less than a step before."""
    sensor = np.array([0.3, -0.2, 0.7])
    points = np.concatenate([around(sensor, 300, 1), around(sensor, 100, 2, 0.0, 3 * EDGE), sensor[None]])
    for reach in (np.inf, 2.5):
        w = walk(margin=1.7 * EDGE, reach=reach)
        for point in points:
            samples, _ = sampled(sensor, point[None], w)
            t, length = np.linalg.norm(samples - sensor, axis=1), math.dist(sensor, point)
            last = min(length - 1.7 * EDGE, reach)
            if last >= 2 * EDGE:
                assert last - EDGE < t[0] <= last + 1e-12
                assert EDGE <= t[-1] < 2 * EDGE
                np.testing.assert_allclose(np.diff(t), -EDGE)
            else:
                assert len(t) <= 1
                assert (t <= last).all()


def test_phases_are_spread_over_a_voxel() -> None:
    drawn = phases(np.zeros(3), around(np.zeros(3), 8000, 3), seed=0)
    assert ((drawn > -1e-9) & (drawn < 1 + 1e-9)).all()
    counts = np.histogram(drawn, 10, (0, 1))[0]
    assert (np.abs(counts - 800) < 5 * math.sqrt(8000 * 0.1 * 0.9)).all()


class TestThinning:
    """Far from their ends samples count in some voxels of the world, and in those always."""

    def voxels(self, sensor: F64, cloud: int, thin: int, **changed: Any) -> set[tuple[int, ...]]:
        w = walk(near=0.0, thin=thin, **changed)
        _, keys = sampled(sensor, around(sensor, 3000, cloud, 2.0, 4.0), w)
        return set(map(tuple, world(keys, w).tolist()))

    @pytest.mark.parametrize("thin", [2, 8, 31])
    def test_the_share_of_voxels(self, thin: int) -> None:
        every, some = (self.voxels(np.array([0.31, 0.17, 0.73]), 4, k) for k in (1, thin))
        assert some < every
        p = 1 / thin
        for octant in np.ndindex(2, 2, 2):
            n, m = (sum(all((v > 0) == o for v, o in zip(voxel, octant)) for voxel in s) for s in (every, some))
            assert n > 2000
            assert abs(m - n * p) < 5 * math.sqrt(n * p * (1 - p))

    @pytest.mark.parametrize(
        "other",
        [
            {"origin": np.array([CELL * 7.0, -CELL * 3.0, CELL])},
            {"origin": np.array([-12345.0, 678.0, 9.0])},
            {"seed": 5},
            {"share": 0.7},
            {"margin": 0.37},
            {"reach": 3.1},
        ],
        ids=lambda changed: next(iter(changed)),
    )
    def test_the_same_voxels_for_all(self, other: dict[str, Any]) -> None:
        here, there = np.array([0.31, 0.17, 0.73]), np.array([-0.62, 0.48, 0.15])
        every, some = (self.voxels(here, 4, thin) for thin in (1, 8))
        every_other, some_other = (self.voxels(there, 6, thin, **other) for thin in (1, 8))
        both = every & every_other
        assert len(both) > 5000
        assert some & both == some_other & both

    def test_a_different_share_keeps_the_voxels_of_the_smaller(self) -> None:
        here = np.array([0.31, 0.17, 0.73])
        assert self.voxels(here, 4, 16) < self.voxels(here, 4, 8) < self.voxels(here, 4, 4)

    def test_near_their_ends_all_count(self) -> None:
        sensor = np.array([0.31, 0.17, 0.73])
        points = around(sensor, 200, 7)
        for near in (0.0, 0.23, 2.0, 100.0):
            w = walk(near=near, thin=8)
            every, close = naive_walk(sensor, points, w)
            far = set(map(tuple, world(sampled(sensor, points, walk(near=0.0, thin=8))[1], w).tolist()))
            counts = [tuple(v) in far for v in np.floor(every / EDGE).astype(int).tolist()]
            np.testing.assert_allclose(sampled(sensor, points, w)[0], every[close | counts], rtol=0, atol=1e-9)


class TestDraw:
    """A share of the rays, drawn by their direction and length, not by their place in the cloud."""

    def drawn(self, points: F64, share: float, seed: int = 0) -> set[int]:
        """Which rays from the origin have samples."""
        samples, _ = sampled(np.zeros(3), points, walk(share=share, seed=seed))
        unit = points / np.linalg.norm(points, axis=1, keepdims=True)
        distance, index = cKDTree(unit).query(samples / np.linalg.norm(samples, axis=1, keepdims=True))
        assert distance.max(initial=0) < 1e-9
        return set(index.tolist())

    def image(self) -> F64:
        """A wall in the regular steps of a depth image."""
        y, z = np.meshgrid(np.arange(-64, 64) * 0.02, np.arange(-64, 64) * 0.02)
        return np.column_stack([np.full(y.size, 2.0), y.ravel(), z.ravel()])

    @pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
    @pytest.mark.parametrize("regular", [False, True])
    def test_the_share_of_rays(self, regular: bool, share: float) -> None:
        points = self.image() if regular else around(np.zeros(3), 16384, 8, 0.5)
        mine = np.zeros(len(points))
        mine[list(self.drawn(points, share))] = 1
        for part in mine.reshape(8, 16, 8, 16).transpose(0, 2, 1, 3).reshape(64, -1):  # squares of the image
            assert abs(part.sum() - 256 * share) < 5 * math.sqrt(256 * share * (1 - share))
        assert abs(mine.sum() - 16384 * share) < 5 * math.sqrt(16384 * share * (1 - share))

    @pytest.mark.parametrize("share", [1.0, 1.7, 1e9])
    def test_all_rays(self, share: float) -> None:
        assert len(self.drawn(self.image(), share)) == 128 * 128

    def test_no_ray(self) -> None:
        assert self.drawn(self.image(), 1e-12) == set()

    def test_seeds_draw_others(self) -> None:
        a, b = (self.drawn(self.image(), 0.3, seed) for seed in (0, 1))
        n, p = 128 * 128, 0.3**2
        assert abs(len(a & b) - n * p) < 5 * math.sqrt(n * p * (1 - p))
        assert self.drawn(self.image(), 0.3, 1) == b

    def test_a_larger_share_draws_the_same_and_more(self) -> None:
        assert self.drawn(self.image(), 0.2) < self.drawn(self.image(), 0.4)

    def test_the_order_of_points_does_not_matter(self) -> None:
        points = around(np.zeros(3), 2000, 9)
        w = walk(share=0.4, thin=3)
        samples, keys = sampled(np.zeros(3), points, w)
        shuffled, shuffled_keys = sampled(np.zeros(3), points[np.random.default_rng(0).permutation(2000)], w)
        a, b = np.lexsort(samples.T), np.lexsort(shuffled.T)
        assert len(samples) > 2000
        np.testing.assert_array_equal(shuffled[b], samples[a])
        np.testing.assert_array_equal(shuffled_keys[b], keys[a])


@pytest.mark.parametrize("workers", [1, 3, 7, 5000])
def test_any_number_of_threads(workers: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """More samples than fit the first buffers, too: they grow."""
    points = around(np.zeros(3), 2000, 10, 3.0)
    parts = [sampled(np.zeros(3), part, walk()) for part in np.array_split(points, 50)]
    assert sum(len(keys) for _, keys in parts) > 1 << 16
    monkeypatch.setattr(rays, "n_workers", lambda: workers)
    samples, keys = sampled(np.zeros(3), points, walk())
    np.testing.assert_array_equal(samples, np.concatenate([s for s, _ in parts]))
    np.testing.assert_array_equal(keys, np.concatenate([k for _, k in parts]))


@pytest.mark.parametrize("shift", [0.0, 5e6])
@pytest.mark.parametrize("thin", [1, 8, NONE])
def test_watched_voxels(thin: int, shift: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples in them count wherever they are, and which of them a ray has passed is told."""
    monkeypatch.setattr(rays, "n_workers", lambda: 3)
    rng = np.random.default_rng(11)
    sensor = np.array([0.31, 0.17, 0.73]) + shift
    points = around(sensor, 300, 12)
    w = walk(thin=thin, origin=np.floor(sensor / EDGE), share=0.8, near=1.5 * EDGE)
    of_all = sampled(sensor, points, walk(origin=w.origin, share=0.8))[1]
    of_some = sampled(sensor, points, w)[1]

    table = VoxelTable()
    table.insert(rng.permutation(np.unique(of_all))[::2])
    somewhere = sensor + rng.uniform(-4, 4, (3000, 3))
    table.insert(voxel_keys(somewhere, EDGE, w.origin))
    watched = rng.random(len(table)) < 0.5
    samples, keys, passed = free_samples(sensor, points, w, table, watched)

    walked = set(of_all.tolist())
    naive_passed = [row for row, key in enumerate(table.keys.tolist()) if watched[row] and key in walked]
    assert 500 < len(naive_passed) < np.count_nonzero(watched) - 500
    assert np.flatnonzero(passed).tolist() == naive_passed
    in_watched = np.isin(keys, table.keys[watched])
    assert np.count_nonzero(in_watched) == np.isin(of_all, table.keys[watched]).sum()
    unwatched = of_some[~np.isin(of_some, table.keys[watched])]
    np.testing.assert_array_equal(keys[~in_watched], unwatched)
    np.testing.assert_array_equal(voxel_keys(samples, EDGE, w.origin), keys)


def test_nothing_watched_of_many() -> None:
    points = around(np.zeros(3), 300, 13)
    samples, keys = sampled(np.zeros(3), points, walk(thin=8))
    table = VoxelTable()
    table.insert(np.unique(keys))
    again, again_keys, passed = free_samples(
        np.zeros(3), points, walk(thin=8), table, np.zeros(len(table), dtype=bool)
    )
    assert not passed.any()
    np.testing.assert_array_equal(again, samples)
    np.testing.assert_array_equal(again_keys, keys)


@pytest.mark.parametrize(("height", "edge"), [(0.3, 0.1), (1.2, 0.2), (0.15, 0.05)])
def test_a_level_lidar_on_a_face_between_voxels(height: float, edge: float) -> None:
    """All its samples, and all its points, lie where rounding decides: it must decide alike."""
    a = np.linspace(0, 6, 50)
    points = np.column_stack([4 * np.cos(a), 4 * np.sin(a), np.full(50, height)])
    points[::2, 2] = np.nextafter(height, 0)  # a hair off level
    for origin in (np.zeros(3), np.array([-640.0, 128.0, 64.0])):
        w = walk(resolution=edge, origin=origin)
        samples, keys = sampled(np.array([0.013, 0.027, height]), points, w)
        inner = off_faces(samples + np.array([0, 0, edge / 2]), edge)
        np.testing.assert_array_equal(keys[inner], voxel_keys(samples, edge, w.origin)[inner])


def test_rounding_does_not_depend_on_the_origin() -> None:
    sensor = np.array([0.5, 0.5, 5 - 3 * 2.0**-35])
    point = sensor + np.array([[20.0, 0, 0]])
    here, there = (walk(resolution=1.0, origin=np.array([0, 0, z])) for z in (0.0, 64.0))
    a, b = (world(sampled(sensor, point, w)[1], w) for w in (here, there))
    np.testing.assert_array_equal(a, b)
