"""The Semantic OctoMap by itself: codes of voxels, rays, log-odds and the cells of the tree."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.errors import InputError
from semgp.octomap.morton import DEPTH, HALF, OUTSIDE, cell_centres, voxel_codes
from tests.octomap.clouds import assert_same, built, random_cloud, seen_from, voxels_of

HIT, MISS, LOW, HIGH = (np.log(p / (1 - p)) for p in (0.7, 0.4, 0.1192, 0.971))


class TestCodes:
    @settings(deadline=None)
    @given(st.lists(st.integers(-HALF, HALF - 1), min_size=3, max_size=3))
    def test_a_code_interleaves_the_keys(self, keys: list[int]) -> None:
        centre = np.array([keys], dtype=np.float32) + np.float32(0.5)
        expected = sum(
            (key + HALF >> bit & 1) << 3 * bit + axis for axis, key in enumerate(keys) for bit in range(DEPTH)
        )
        codes = voxel_codes(centre, 1.0)
        assert codes.tolist() == [expected]
        np.testing.assert_array_equal(cell_centres(codes, np.array([DEPTH]), 1.0), centre)

    def test_points_beyond_the_root_have_no_code(self) -> None:
        rim = HALF * 0.5
        points = np.array([[rim, 0, 0], [0, -rim - 0.1, 0], [0, 0, 1e30], [0, 0, -rim], [rim - 0.1, 0, 0]])
        outside = voxel_codes(points.astype(np.float32), 0.5) == OUTSIDE
        assert outside.tolist() == [True, True, True, False, False]


class TestOccupancy:
    def test_a_ray_frees_what_it_passes_and_hits_where_it_ends(self) -> None:
        octomap = built(seen_from((0.05, 0.05, 0.05), [[0.95, 0.05, 0.05]]))
        along = octomap.query_occupancy(np.array([[x, 0.05, 0.05] for x in np.arange(-0.05, 1.2, 0.1)]))
        expected = [0, *[MISS] * 9, HIT, 0, 0]
        np.testing.assert_allclose(along.log_odds, expected, rtol=1e-6)
        assert along.known.tolist() == [False, *[True] * 10, False, False]
        assert along.occupied.tolist() == [False] * 10 + [True, False, False]
        assert along.free.tolist() == [False, *[True] * 9, False, False, False]
        np.testing.assert_allclose(along.probability[[0, 1, 10]], [0.5, 0.4, 0.7], atol=1e-6)
        assert len(octomap) == 10

    def test_a_hit_wins_over_rays_that_pass_and_each_voxel_is_updated_once(self) -> None:
        octomap = built(
            seen_from((0.05, 0.05, 0.05), [[0.95, 0.05, 0.05], [0.55, 0.05, 0.05], [0.56, 0.05, 0.05]])
        )
        both = octomap.query_occupancy([[0.55, 0.05, 0.05], [0.15, 0.05, 0.05]])
        np.testing.assert_allclose(both.log_odds, [HIT, MISS], rtol=1e-6)

    def test_log_odds_are_clamped(self) -> None:
        cloud = seen_from((0.05, 0.05, 0.05), [[0.35, 0.05, 0.05]])
        octomap = built(*[cloud] * 9)
        np.testing.assert_allclose(
            octomap.query_occupancy([[0.35, 0.05, 0.05], [0.15, 0.05, 0.05]]).log_odds, [HIGH, LOW], rtol=1e-6
        )

    def test_rays_beyond_the_range_are_cut_and_hit_nothing(self) -> None:
        octomap = built(seen_from((0.05, 0.05, 0.05), [[0.95, 0.05, 0.05]], labels=[1]), max_range=0.5)
        assert len(octomap) == 5
        assert len(octomap.occupied()) == 0
        with pytest.raises(InputError, match="no labels"):
            octomap.query([[0.95, 0.05, 0.05]])

    def test_without_rays_nothing_becomes_free(self) -> None:
        cloud = replace(random_cloud(0), T_world_sensor=None)
        octomap = built(cloud, rays=False)
        centres = octomap.occupied(pruned=False).centres
        assert set(voxels_of(centres, 0.1)) == set(voxels_of(cloud.points, 0.1))
        assert len(octomap.free()) == 0

    @pytest.mark.parametrize("discretize", [False, True])
    def test_known_and_unknown_cells_fill_the_root(self, discretize: bool) -> None:
        octomap = built(random_cloud(1), random_cloud(2), discretize=discretize)
        cells = [octomap.occupied(), octomap.free(), octomap.unknown()]
        volume = sum(float(np.sum((part.sizes / 0.1).round() ** 3)) for part in cells)
        assert volume == float(2**48)
        assert not octomap.query_occupancy(cells[2].centres).known.any()
        known = octomap.leaves(pruned=False)
        np.testing.assert_array_equal(octomap.query_occupancy(known.centres).log_odds, known.log_odds)
        assert len(known) == len(octomap) > len(octomap.leaves())

    def test_unknown_cells_of_a_box(self) -> None:
        octomap = built(random_cloud(1))
        cells = octomap.unknown((-1, -1, -1), (0, 0, 0))
        grid = np.stack(np.meshgrid(*[np.arange(-0.95, 0, 0.1)] * 3), axis=-1).reshape(-1, 3)
        missing = grid[~octomap.query_occupancy(grid).known]
        half = cells.sizes[:, None] / 2
        inside = [bool((np.abs(p - cells.centres) < half).all(axis=1).any()) for p in missing]
        assert all(inside)
        assert len(cells) < len(octomap.unknown())

    @pytest.mark.parametrize("depth", [0, 3, 11, 13, 14, 15, 16])
    def test_a_coarser_cell_has_the_greatest_log_odds_within(self, depth: int) -> None:
        octomap = built(random_cloud(3), random_cloud(4))
        voxels = octomap.leaves(pruned=False)
        size = 0.1 * 2 ** (DEPTH - depth)
        greatest: dict[tuple[float, ...], float] = defaultdict(lambda: -np.inf)
        for cell, value in zip(np.floor(voxels.centres / size).tolist(), voxels.log_odds.tolist()):
            greatest[tuple(cell)] = max(greatest[tuple(cell)], value)
        points = np.random.default_rng(0).uniform(-3, 3, (500, 3))
        points = points[(np.abs(points / 0.1 - np.round(points / 0.1)) > 1e-3).all(axis=1)]
        found = octomap.query_occupancy(points, depth)
        cells = [tuple(cell) for cell in np.floor(points / size).tolist()]
        expected = np.array([greatest.get(cell, 0) for cell in cells])
        if depth > 0:  # the root holds the cells on both sides of zero
            assert found.known.tolist() == [cell in greatest for cell in cells]
            np.testing.assert_array_equal(found.log_odds, expected.astype(np.float32))
        else:
            assert found.known.all()
            assert (found.log_odds == voxels.log_odds.max()).all()

    def test_giving_memory_back_changes_nothing(self) -> None:
        octomap, twin = built(random_cloud(5), random_cloud(6)), built(random_cloud(5), random_cloud(6))
        octomap.prune()
        assert octomap.info()["memory_bytes"] <= twin.info()["memory_bytes"]
        for cloud in (random_cloud(7), random_cloud(8)):
            octomap.update(cloud)
            twin.update(cloud)
        assert_same(octomap, twin)

    def test_the_origin_moves_the_map(self) -> None:
        shift = np.array([500_000.0, 5_000_000.0, 200.0])
        cloud = random_cloud(9)
        T = np.array(cloud.T_world_sensor)
        T[:3, 3] += shift
        far = built(replace(cloud, points=cloud.points + shift, T_world_sensor=T), origin=shift + 0.03)
        np.testing.assert_allclose(far.origin, shift, atol=1e-6)  # a whole voxel
        here = built(cloud)
        np.testing.assert_allclose(far.leaves().centres - shift, here.leaves().centres, atol=1e-6)
        np.testing.assert_array_equal(far.leaves().log_odds, here.leaves().log_odds)
