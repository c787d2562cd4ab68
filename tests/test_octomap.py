"""The Semantic OctoMap by itself: rays, classes, colours, queries, bad input. No other library is needed."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.octomap import SemanticOctoMap, SensorModel
from semgp.octomap.morton import DEPTH, HALF, OUTSIDE, cell_centres, voxel_codes

CLASSES = Classes(("floor", "wall", "chair"))
HIT, MISS, LOW, HIGH = (np.log(p / (1 - p)) for p in (0.7, 0.4, 0.1192, 0.971))


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


class TestClasses:
    @settings(max_examples=25, deadline=None)
    @given(st.integers(0, 2**32 - 1), st.booleans())
    def test_a_voxel_averages_its_labels(self, seed: int, soft: bool) -> None:
        rng = np.random.default_rng(seed)
        clouds = [
            seen_from((0, 0, 0), rng.uniform(-0.4, 0.4, (150, 3)), **random_labels(rng, 150, soft))
            for _ in range(2)
        ]
        mass: dict[tuple[int, ...], NDArray[np.float64]] = defaultdict(lambda: np.zeros(3))
        for cloud in clouds:
            for voxel, weight in zip(voxels_of(cloud.points, 0.1), cloud.class_weights):
                mass[voxel] += weight
        points = np.vstack([clouds[0].points, rng.uniform(-0.5, 0.5, (50, 3))])
        prediction = built(*clouds).query(points)
        expected = np.array([mass[voxel] for voxel in voxels_of(points, 0.1)])
        observed = expected.sum(axis=1) > 0
        expected[~observed] = 1
        np.testing.assert_array_equal(prediction.observed, observed)
        np.testing.assert_allclose(
            prediction.probability, expected / expected.sum(axis=1, keepdims=True), atol=1e-5
        )

    def test_unlabelled_points_tell_of_occupancy_and_colour_only(self) -> None:
        points = [[0.95, 0.05, 0.05], [0.95, 0.55, 0.05]]
        colours = [[10, 20, 30], [40, 50, 60]]
        octomap = built(seen_from((0, 0, 0), points, labels=[2, MISSING], colours=colours))
        assert octomap.query_occupancy(points).occupied.all()
        prediction = octomap.query(points)
        assert prediction.observed.tolist() == [True, False]
        assert prediction.label.tolist() == [2, MISSING]
        np.testing.assert_allclose(prediction.probability, np.array([[0, 0, 3], [1, 1, 1]]) / 3)
        found, known = octomap.query_colours([*points, [0.5, 0, 0]])
        assert known.tolist() == [True, True, False]
        assert found[:2].tolist() == colours

    def test_occupancy_does_not_depend_on_labels(self) -> None:
        cloud = random_cloud(10)
        bare = built(replace(cloud, labels=None, colours=None))
        labelled = built(cloud)
        np.testing.assert_array_equal(bare.leaves().log_odds, labelled.leaves().log_odds)
        np.testing.assert_array_equal(bare.leaves().centres, labelled.leaves().centres)

    def test_colours_are_averaged_whether_or_not_each_cloud_has_them(self) -> None:
        point = [[0.95, 0.05, 0.05]]
        plain = seen_from((0, 0, 0), [[0.55, 0.05, 0.05], *point], labels=[0, 1])
        octomap = built(plain)
        for colour in ([10, 0, 255], [20, 1, 255]):
            octomap.update(seen_from((0, 0, 0), point, colours=[colour]))
        octomap.update(plain)
        colours, known = octomap.query_colours([*point, [0.55, 0.05, 0.05]])
        assert known.tolist() == [True, False]
        assert colours[0].tolist() == [15, 0, 255]  # 0.5 rounds to even

    def test_memory_follows_the_classes_met_not_those_there_are(self) -> None:
        cloud = random_cloud(11)
        many = Classes.numbered(1000)
        few = SemanticOctoMap(CLASSES, 0.1)
        few.update(cloud)
        wide = SemanticOctoMap(many, 0.1)
        wide.update(replace(cloud, classes=many, labels=np.where(cloud.hard_labels == 2, 999, cloud.hard_labels)))
        assert wide.info()["label_bytes"] == few.info()["label_bytes"]
        assert wide.query(cloud.points).label.max() == 999

    def test_positions_are_the_labelled_voxels(self) -> None:
        cloud = random_cloud(12)
        octomap = built(cloud)
        assert set(voxels_of(octomap.positions, 0.1)) == set(voxels_of(cloud.points[cloud.labelled], 0.1))
        assert len(octomap.positions) == octomap.info()["labelled_voxels"]


class TestStorage:
    def test_arrays_keep_everything(self) -> None:
        octomap = built(
            random_cloud(13), random_cloud(14), max_range=1.5, sensor=SensorModel(hit=0.8), origin=(1, 2, 3)
        )
        header, arrays = octomap.to_arrays()
        again = SemanticOctoMap.from_arrays(CLASSES, header, arrays)
        assert again.info()["sensor"] == octomap.info()["sensor"]
        for cloud in (None, random_cloud(15)):
            if cloud is not None:
                octomap.update(cloud)
                again.update(cloud)
            assert_same(octomap, again)

    @pytest.mark.parametrize(
        ("name", "damage"),
        [
            ("bricks", lambda a: a[::-1]),
            ("bricks", lambda a: a - a[0] - 1),
            ("bricks", lambda a: a.astype(np.int32)),
            ("known", lambda a: a[1:]),
            ("known", lambda a: a * 0),
            ("log_odds", lambda a: a * np.nan),
            ("mixed_bricks", lambda a: a + 10**6),
            ("mixed_log_odds", lambda a: a[:, :3]),
            ("voxels", lambda a: a | 1 << 48),
            ("voxel_classes", lambda a: a - 1),
            ("class", lambda a: a + 3),
            ("mass", lambda a: -a),
            ("colour_sums", lambda a: a[:5]),
        ],
    )
    def test_damaged_arrays_are_refused(self, name: str, damage: object) -> None:
        header, arrays = built(random_cloud(16)).to_arrays()
        arrays[name] = damage(arrays[name])  # type: ignore[operator]
        with pytest.raises(InputError, match="stored"):
            SemanticOctoMap.from_arrays(CLASSES, header, arrays)

    @pytest.mark.parametrize("name", ["resolution", "sensor", "rays"])
    def test_a_header_that_lacks_something_is_refused(self, name: str) -> None:
        header, arrays = built(random_cloud(17)).to_arrays()
        del header[name]
        with pytest.raises(InputError, match=name):
            SemanticOctoMap.from_arrays(CLASSES, header, arrays)


class TestBadInput:
    @pytest.mark.parametrize("resolution", [0, -0.1, np.nan, np.inf, "fine"])
    def test_resolution(self, resolution: float) -> None:
        with pytest.raises(InputError, match="resolution"):
            SemanticOctoMap(CLASSES, resolution)

    def test_other_settings(self) -> None:
        with pytest.raises(InputError, match="max_range"):
            SemanticOctoMap(CLASSES, max_range=0)
        with pytest.raises(InputError, match="origin"):
            SemanticOctoMap(CLASSES, origin=(0, np.nan, 0))
        with pytest.raises(InputError, match="upper"):
            built(random_cloud(0)).unknown((0, 0, 0), (1, 1))
        with pytest.raises(InputError, match="clamp_min"):
            SensorModel(hit=0.3)
        with pytest.raises(InputError, match="threshold"):
            SensorModel(threshold=1)

    def test_rays_need_a_pose(self) -> None:
        with pytest.raises(InputError, match="rays=False"):
            built(replace(random_cloud(0), T_world_sensor=None))

    def test_other_classes(self) -> None:
        with pytest.raises(InputError, match="classes"):
            SemanticOctoMap(Classes(("road",))).update(random_cloud(0))

    def test_an_empty_cloud_changes_nothing(self) -> None:
        cloud = random_cloud(18)
        octomap, twin = built(cloud), built(cloud)
        octomap.update(cloud[:0])
        assert_same(octomap, twin)

    @pytest.mark.parametrize("rays", [True, False])
    def test_points_beyond_reach_are_refused_and_the_map_stays(self, rays: bool) -> None:
        cloud = random_cloud(19)
        octomap, twin = built(cloud, rays=rays), built(cloud, rays=rays)
        far = replace(cloud, points=np.vstack([cloud.points[1:], [[5e6, 0, 0]]]))
        with pytest.raises(InputError, match=r"point .* beyond the map, which reaches 3276\.8 m"):
            octomap.update(far)
        assert_same(octomap, twin)

    def test_a_sensor_beyond_reach_is_refused(self) -> None:
        with pytest.raises(InputError, match=r"sensor .* origin"):
            built(seen_from((0, -1e5, 0), [[0, 0, 0]]))

    def test_queries_beyond_reach_are_unknown(self) -> None:
        octomap = built(random_cloud(20))
        assert not octomap.query([[5e6, 5e6, 0], [0, 0, -1e300]]).observed.any()
        for depth in (0, 5, None):
            assert not octomap.query_occupancy([[5e6, 5e6, 0]], depth).known.any()

    @pytest.mark.parametrize("depth", [-1, 17, 2.5])
    def test_depth(self, depth: int) -> None:
        with pytest.raises(InputError, match="depth"):
            built(random_cloud(0)).query_occupancy([[0, 0, 0]], depth)

    def test_a_map_without_labels_says_so(self) -> None:
        with pytest.raises(InputError, match="no labels"):
            built().query([[0, 0, 0]])


def random_labels(rng: np.random.Generator, n: int, soft: bool) -> dict[str, NDArray[np.number]]:
    if not soft:
        return {"labels": rng.integers(-1, 3, n)}
    return {"weights": rng.random((n, 3)) * rng.integers(0, 2, (n, 3)) * rng.integers(0, 2, (n, 1))}


def assert_same(a: SemanticOctoMap, b: SemanticOctoMap) -> None:
    first, second = a.to_arrays(), b.to_arrays()
    assert first[0] == second[0]
    a_leaves, b_leaves = a.leaves(), b.leaves()
    np.testing.assert_array_equal(a_leaves.centres, b_leaves.centres)
    np.testing.assert_array_equal(a_leaves.log_odds, b_leaves.log_odds)
    for name in ("bricks", "known", "voxels", "voxel_classes", "colour_sums"):
        np.testing.assert_array_equal(first[1][name], second[1][name], err_msg=name)
    np.testing.assert_array_equal(a.query(a.positions).probability, b.query(a.positions).probability)
