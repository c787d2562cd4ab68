"""Which of the rays have samples, and which of their samples count."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from semgp.blocks.cells import CELL
from tests.maps.rays.walks import EDGE, around, naive_walk, sampled, walk, world

F64 = NDArray[np.float64]


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
