"""Free space in the map: what rays tell, beside the classes, and what no ray told."""

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from semgp.blocks.accumulate import MASS_UNIT
from semgp.blocks.cells import CELL, cell_origin
from semgp.blocks.model import BlockModel
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.model import GPModel
from semgp.maps import occupancy
from semgp.maps.files import load_map, save_map
from semgp.maps.free_space import FreeSpace, occupancy_model
from semgp.maps.gp import GPSemanticMap
from semgp.maps.occupancy import Occupancy, Rays
from semgp.maps.rays import Walk, free_samples
from semgp.parallel import n_workers
from semgp.prediction import FREE, OCCUPIED, UNKNOWN, OccupancyPrediction, Prediction
from semgp.voxels import VoxelTable, voxel_indices

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


class TestOccupancy:
    def corridor(self, shift: float) -> tuple[GPSemanticMap, F64]:
        """A wall of 3 m x 3 m, 3 m ahead, seen three times."""
        offset = np.array([shift, -shift, 0.0])
        clouds = []
        for seed in range(3):
            y, z = np.random.default_rng(seed).uniform(-1.5, 1.5, (2, 1500))
            points = np.column_stack([np.full(1500, 3.04), y, z]) + offset
            sensor = np.array([0.013, 0.027, 0.041]) + offset
            clouds.append(LabelledCloud(points, SIX, np.full(1500, 1), T_world_sensor=pose(sensor)))
        return built(clouds), offset

    @pytest.mark.parametrize("shift", [0.0, 5e6])
    def test_before_a_wall_it_is_free_and_behind_unknown(self, shift: float) -> None:
        made, offset = self.corridor(shift)
        rng = np.random.default_rng(7)
        slope = rng.uniform(-0.4, 0.4, (500, 2))

        def state(x: F64, aside: F64) -> NDArray[np.int8]:
            return made.occupancy(np.column_stack([x, aside]) + offset).state

        x = rng.uniform(0.5, 2.7, 500)
        assert (state(x, slope * x[:, None]) == FREE).all()
        assert (state(np.full(500, 3.04), slope * 3) == OCCUPIED).mean() > 0.98
        assert (state(rng.uniform(3.5, 9.0, 500), slope * 3) == UNKNOWN).all()
        assert (state(x, 0.5 * x[:, None] * np.sign(slope) + 0.5 * np.sign(slope)) == UNKNOWN).all()
        assert (state(-x, slope * x[:, None]) == UNKNOWN).all()

    def test_what_it_says_is_what_queries_say(self) -> None:
        made = built(room())
        alone, beside = made.occupancy(queries()), occupancy_of(made.query(queries()))
        np.testing.assert_array_equal(alone.probability, beside.probability)
        np.testing.assert_array_equal(alone.known, beside.known)
        assert ((alone.probability >= 0) & (alone.probability <= 1)).all()
        assert {FREE, OCCUPIED, UNKNOWN} == set(alone.state.tolist())

    def test_positions_are_those_of_sites(self) -> None:
        made = built(room())
        assert (made.occupancy(made.free_positions).state == FREE).mean() > 0.98
        assert (made.occupancy(made.occupied_positions).state == OCCUPIED).mean() > 0.9
        sites = sites_of(made)
        mass = sites["free.mass"].astype(int)
        assert len(made.free_positions) == (mass[:, 0] > mass[:, 1]).sum()
        assert len(made.occupied_positions) == (mass[:, 1] > mass[:, 0]).sum() > 1000
        depth = np.minimum(made.occupied_positions - LOW, HIGH - made.occupied_positions).min(axis=1)
        assert np.abs(depth).max() < 0.1
        assert made.resolution == EDGE

    def test_as_often_passed_as_met(self) -> None:
        """Such sites are neither free nor occupied."""
        ends = np.array([[1.55, 0.05, 0.05], [3.05, 0.05, 0.05]])
        clouds = [LabelledCloud(end[None], SIX, T_world_sensor=pose((0.05, 0.05, 0.05))) for end in ends]
        made = built(clouds, FreeSpace(weight=1.0, thin=1))
        ties = [
            index[0]
            for index, mass in zip(*(sites_of(made)["free." + n] for n in ("index", "mass")))
            if mass.all()
        ]
        assert ties == [15]
        np.testing.assert_allclose(made.occupied_positions, ends[1:], atol=1e-8)
        assert len(made.free_positions) == made.info()["free_sites"] - 2 > 20
        assert not ((made.free_positions[:, 0] > 1.5) & (made.free_positions[:, 0] < 1.6)).any()

    def test_a_map_of_nothing_knows_nothing(self) -> None:
        made = GPSemanticMap(SIX, MODEL, free=FREE_SPACE)
        nothing = made.occupancy(queries(10))
        assert not nothing.known.any()
        np.testing.assert_allclose(nothing.probability, nothing.probability[0])
        assert made.free_positions.shape == made.occupied_positions.shape == (0, 3)
        far = built(room()).occupancy(queries(10) + 1000)
        np.testing.assert_allclose(far.probability, nothing.probability, atol=1e-6)
        assert not far.known.any()


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


class TestNothingButTheDataDecides:
    @pytest.mark.parametrize("soft", [False, True])
    @pytest.mark.parametrize("posterior", ["pool", "vote"])
    def test_classes_are_the_same_with_free_space_and_without(self, soft: bool, posterior: str) -> None:
        clouds, model = room(), BlockModel(resolution=EDGE, posterior=posterior)
        if soft:
            clouds = [replace(c, labels=None, weights=c.class_weights * np.float32(0.7)) for c in clouds]
        clouds = [c[np.argsort(~c.labelled, kind="stable")] for c in clouds]  # a label comes first
        with_free, without = built(clouds, model=model), built(clouds, free=None, model=model)
        plain = sites_of(without)
        assert_same_sites({name: a for name, a in sites_of(with_free).items() if name in plain}, plain)
        a, b = with_free.query(queries()), without.query(queries())
        np.testing.assert_array_equal(a.probability, b.probability)
        np.testing.assert_array_equal(a.variance, b.variance)
        np.testing.assert_array_equal(a.observed, b.observed)
        assert b.occupancy is None
        np.testing.assert_array_equal(with_free.positions, without.positions)

    def test_a_map_that_begins_without_a_label(self) -> None:
        """Its keys begin elsewhere then, and that decides nothing."""
        clouds = [scan(PLACES[0], 0, labels=None), *room()]
        clouds[0] = moved(clouds[0], (30.0, 0, 0))
        with_free, without = built(clouds), built(clouds, free=None)
        plain = sites_of(without)
        assert_same_sites({name: a for name, a in sites_of(with_free).items() if name in plain}, plain)
        assert (with_free.to_arrays()[1]["origin"] != without.to_arrays()[1]["origin"]).any()
        np.testing.assert_array_equal(with_free.query(queries()).probability, without.query(queries()).probability)

    @pytest.mark.parametrize("order", [[3, 2, 1, 0], [1, 3, 0, 2]], ids=str)
    @pytest.mark.parametrize("shift", [0.0, 5e6])
    def test_any_order_of_scans(self, order: list[int], shift: float) -> None:
        offset = np.array([shift, -shift, 0.0])
        clouds = [moved(c, offset) for c in room()]
        forward = built(clouds)
        other = GPSemanticMap(SIX, MODEL, free=FREE_SPACE)
        for i in order:
            other.update(clouds[i])
            other.query(queries(50) + offset)  # asked in between
            other.update(clouds[i][:0])
        assert_same(forward, other, queries() + offset)

    @pytest.mark.skipif(
        not hasattr(os, "sched_setaffinity") or n_workers() < 2, reason="needs two cores to compare with"
    )
    def test_any_number_of_threads(self) -> None:
        cores = os.sched_getaffinity(0)
        many = built(room())
        many.solve()
        try:
            os.sched_setaffinity(0, {min(cores)})
            one = built(room())
            one.solve()
        finally:
            os.sched_setaffinity(0, cores)
        assert_same(many, one)

    def test_files(self, tmp_path: Path) -> None:
        clouds = room()
        free = FreeSpace(
            occupancy_model(EDGE, vertical=2), rays=500, weight=0.4, margin=1.5, thin=3, reach=4.0, seed=2
        )
        made = built(clouds[:2], free)
        save_map(made, tmp_path / "room.semgp")
        loaded = load_map(tmp_path / "room.semgp")
        assert isinstance(loaded, GPSemanticMap)
        assert loaded.free == made.free == free
        assert_same(loaded, made)
        for cloud in clouds[2:]:  # and it goes on living
            loaded.update(cloud)
            made.update(cloud)
        assert_same(loaded, made)

    def test_files_without_free_space(self, tmp_path: Path) -> None:
        made = built(room(), free=None)
        save_map(made, tmp_path / "room.semgp")
        loaded = load_map(tmp_path / "room.semgp")
        assert isinstance(loaded, GPSemanticMap)
        assert loaded.free is None
        assert loaded.query(queries(10)).occupancy is None

    def test_solving_ahead(self) -> None:
        lazy, ahead = built(room()), built(room())
        ahead.solve()
        assert ahead.info()["cells_to_solve"] == ahead.info()["free_cells_to_solve"] == 0
        assert lazy.info()["free_cells_to_solve"] > 0
        assert_same(lazy, ahead)


def test_with_a_tolerance_little_changes_are_left_to_later() -> None:
    clouds = room()
    exact, live = (GPSemanticMap(SIX, MODEL, tolerance, free=FREE_SPACE) for tolerance in (0.0, 5.0))
    for made in (exact, live):
        made.update(clouds[0])
        made.occupancy(queries())
        made.update(clouds[0])
        made.occupancy(queries())
        made.query(queries())
    assert live.info()["free_cells_to_solve"] > exact.info()["free_cells_to_solve"]
    assert occupancy_of(live.query(queries())).state.tolist() == live.occupancy(queries()).state.tolist()


class TestCrop:
    LOW, HIGH = np.array([1.03, 0.92, -0.2]), np.array([3.87, 3.11, 1.93])

    def test_it_keeps_what_lies_inside(self) -> None:
        made = built(room(), FreeSpace(seed=4))
        part = made.crop(self.LOW, self.HIGH)
        assert part.free == made.free

        def inside(X: F64) -> F64:
            return X[((self.LOW <= X) & (self.HIGH > X)).all(axis=1)]

        np.testing.assert_array_equal(part.positions, inside(made.positions))
        np.testing.assert_array_equal(part.free_positions, inside(made.free_positions))
        np.testing.assert_array_equal(part.occupied_positions, inside(made.occupied_positions))
        assert len(part.free_positions) > 1000
        deep = np.random.default_rng(0).uniform(self.LOW + 0.5, self.HIGH - 0.5, (500, 3))
        a, b = part.occupancy(deep), made.occupancy(deep)
        assert (a.state == b.state).mean() > 0.98
        assert np.abs(a.probability - b.probability).mean() < 0.01

    def test_it_goes_on_living(self) -> None:
        part = built(room()).crop(self.LOW, self.HIGH)
        before = part.free_positions
        part.update(scan(PLACES[0], 9))
        assert len(part.free_positions) > len(before)
        grown = set(map(tuple, np.floor(part.free_positions / EDGE).tolist()))
        assert np.mean([tuple(v) in grown for v in np.floor(before / EDGE).tolist()]) > 0.99

    def test_a_part_without_labels_goes_on_living(self) -> None:
        part = built(room()).crop((1.0, 1.0, 0.5), (4.0, 3.0, 2.0))
        assert len(part) == 0
        middle = np.random.default_rng(0).uniform((1.5, 1.5, 0.8), (3.5, 2.5, 1.7), (200, 3))
        before = part.occupancy(middle).state
        part.update(moved(scan(PLACES[0], 9), (40.0, 0, 0)))
        np.testing.assert_array_equal(part.occupancy(middle).state, before)


class TestInfo:
    def test_figures(self) -> None:
        made, plain = built(room()), built(room(), free=None)
        facts = json.loads(json.dumps(made.info(), allow_nan=False))
        sites = sites_of(made)
        assert facts["sites"] == len(made) == len(sites["index"]) == plain.info()["sites"]
        assert facts["free_sites"] == len(sites["free.index"]) > facts["sites"]
        for prefix, name in (("", ""), ("free_", "free.")):
            cells = {tuple(v) for v in (sites[name + "index"] // CELL).tolist()}
            assert facts[prefix + "cells"] == facts[prefix + "cells_to_solve"] == len(cells)
            assert facts[prefix + "blocks_solved"] == facts[prefix + "solved_bytes"] == 0
            assert facts[prefix + "memory_bytes"] > 40 * facts[prefix + "sites"]
            assert facts[prefix + "bytes_a_site"] == round(
                facts[prefix + "memory_bytes"] / facts[prefix + "sites"], 1
            )
        made.occupancy(queries())
        asked = made.info()
        assert asked["blocks_solved"] == 0
        assert asked["free_blocks_solved"] > 0
        assert asked["free_solved_bytes"] > 0
        assert not any(name.startswith("free_") for name in plain.info())
        assert facts["cell_metres"] == pytest.approx(6.4)


class TestWithoutLabels:
    @pytest.mark.parametrize("labels", [None, np.full(800, MISSING, np.int32)], ids=["none", "missing"])
    @pytest.mark.parametrize("posterior", ["pool", "vote", "softmax"])
    def test_points_make_a_map(self, labels: NDArray[np.int32] | None, posterior: str) -> None:
        prior = (0.1, 0.3, 0.2, 0.2, 0.1, 0.1)
        model = BlockModel(resolution=EDGE, posterior=posterior, prior=prior)
        made = built([scan(PLACES[0], 0, labels=labels)], model=model)
        prediction = made.query(queries())
        assert len(made) == 0
        assert made.positions.shape == (0, 3)
        assert not prediction.observed.any()
        assert (prediction.label == MISSING).all()
        np.testing.assert_allclose(prediction.probability.sum(axis=1), 1, rtol=1e-5)
        labelled = built([scan(PLACES[0], 0)], model=model)
        far = labelled.query(queries() + 1e4)
        np.testing.assert_allclose(prediction.probability, far.probability, atol=1e-6)
        np.testing.assert_array_equal(
            occupancy_of(prediction).probability, occupancy_of(labelled.query(queries())).probability
        )
        made.update(scan(PLACES[0], 0))
        assert made.query(queries()).observed.any()

    def test_files(self, tmp_path: Path) -> None:
        made = built([scan(PLACES[0], 0, labels=None)])
        save_map(made, tmp_path / "room.semgp")
        loaded = load_map(tmp_path / "room.semgp")
        assert isinstance(loaded, GPSemanticMap)
        assert_same(loaded, made)
        next_door = moved(scan(PLACES[0], 1), (9.0, 0, 0))
        for semantic_map in (loaded, made):
            semantic_map.update(next_door)
        assert_same(loaded, made)

    def test_still_without_points_there_is_nothing_to_answer_with(self) -> None:
        with pytest.raises(InputError, match="no label"):
            GPSemanticMap(SIX, MODEL, free=FREE_SPACE).query(queries(3))


def test_the_reach_may_be_a_whole_number() -> None:
    assert_same(built(room()[:1], FreeSpace(reach=2)), built(room()[:1], FreeSpace(reach=2.0)))


class TestRefused:
    """Updates that are refused leave a map as it was, new or not."""

    def untouched(self, cloud: LabelledCloud, message: str, began: bool, **settings: Any) -> None:
        made = GPSemanticMap(SIX, MODEL, free=FreeSpace(**settings))
        if began:
            made.update(scan(PLACES[0], 0))
            made.solve()
        before, facts = {name: a.copy() for name, a in made.to_arrays()[1].items()}, made.info()
        with pytest.raises(InputError, match=message):
            made.update(cloud)
        assert_same_sites(made.to_arrays()[1], before)
        assert made.info() == facts
        if not began:  # the map may still begin anywhere
            made.update(moved(scan(PLACES[1], 1), (3e7, 2e7, 0)))
            assert len(made) > 0

    @pytest.mark.parametrize("began", [False, True])
    def test_clouds_without_a_pose(self, began: bool) -> None:
        self.untouched(scan(PLACES[1], 1, T_world_sensor=None), "give its pose", began)

    @pytest.mark.parametrize("began", [False, True])
    def test_stray_points(self, began: bool) -> None:
        cloud = scan(PLACES[1], 1)
        points = cloud.points.copy()
        points[17, 0] += 2e5
        self.untouched(replace(cloud, points=points), "drop stray points", began)

    @pytest.mark.parametrize("began", [False, True])
    def test_stray_labels_beyond_the_reach(self, began: bool) -> None:
        cloud = scan(PLACES[1], 1)
        points, labels = cloud.points.copy(), cloud.hard_labels.copy()
        points[17, 0], labels[17] = 2e5, 0
        self.untouched(replace(cloud, points=points, labels=labels), "drop stray points", began, reach=6.0)

    @pytest.mark.parametrize("began", [False, True])
    def test_stray_sensors(self, began: bool) -> None:
        far = scan(PLACES[1], 1)[:20]
        self.untouched(replace(far, T_world_sensor=pose((2e5, 0, 0))), "away from where the map", began)

    @pytest.mark.parametrize("stray", ["point", "sensor"])
    def test_rays_to_stray_places_are_not_walked(self, stray: str, monkeypatch: pytest.MonkeyPatch) -> None:
        """A ray of 1e8 m has more samples than fit the memory."""
        cloud, walked = scan(PLACES[1], 1)[:20], False
        if stray == "point":
            cloud.points[7] += 2e5
        else:
            cloud = replace(cloud, T_world_sensor=pose((2e5, 0, 0)))

        def walk(*given: Any) -> Any:
            nonlocal walked
            walked = True
            return free_samples(*given)

        monkeypatch.setattr(occupancy, "free_samples", walk)
        with pytest.raises(InputError, match="away from where the map"):
            GPSemanticMap(SIX, MODEL, free=FREE_SPACE).update(cloud)
        assert not walked

    @pytest.mark.parametrize("at", [1e300, 1e18])
    def test_places_without_voxels(self, at: float) -> None:
        self.untouched(scan(PLACES[1], 1, T_world_sensor=pose((at, 0, 0))), "voxels", False)

    def test_stray_sensors_of_a_map_that_began(self) -> None:
        self.untouched(scan(PLACES[1], 1, T_world_sensor=pose((1e300, 0, 0))), "away from where the map", True)

    @pytest.mark.parametrize("began", [False, True])
    def test_heavy_labels(self, began: bool) -> None:
        heavy = np.full((800, 6), 65.0)
        self.untouched(scan(PLACES[1], 1, labels=None, weights=heavy), "64 at most", began)

    def test_points_in_range_of_the_sensor_but_not_of_each_other(self) -> None:
        cloud = scan(PLACES[1], 1)
        points, labels = cloud.points.copy(), np.full(800, MISSING, np.int32)
        points[0, 0], points[1, 0], labels[0] = -8e4, 8e4, 0
        self.untouched(replace(cloud, points=points, labels=labels), "away from where the map", False)

    @pytest.mark.parametrize("began", [False, True])
    def test_missing_features(self, began: bool) -> None:
        model = replace(MODEL, features=("height",))
        made = GPSemanticMap(SIX, model, free=FREE_SPACE)
        if began:
            made.update(scan(PLACES[0], 0, features=np.ones((800, 1)), feature_names=("height",)))
        before = sites_of(made)
        with pytest.raises(InputError, match="'height'"):
            made.update(scan(PLACES[1], 1))
        assert_same_sites(sites_of(made), before)

    @pytest.mark.parametrize("bad", [np.nan, np.inf])
    def test_poses_that_are_none(self, bad: float) -> None:
        with pytest.raises(InputError, match="T_world_sensor"):
            scan(PLACES[0], 0, T_world_sensor=pose((0, bad, 0)))

    @pytest.mark.parametrize("bad", [np.full((2, 3), np.nan), np.zeros((3, 2)), np.zeros(3)])
    def test_queries(self, bad: F64) -> None:
        with pytest.raises(InputError, match="query points"):
            built(room()[:1]).occupancy(bad)


def test_empty_clouds_change_nothing() -> None:
    made = built(room()[:2])
    made.solve()
    before = sites_of(made)
    made.update(room()[3][:0])
    made.update(replace(room()[3][:0], T_world_sensor=None))
    assert_same_sites(sites_of(made), before)
    assert made.info()["cells_to_solve"] == made.info()["free_cells_to_solve"] == 0
    new = GPSemanticMap(SIX, MODEL, free=FREE_SPACE)
    new.update(room()[3][:0])
    assert (len(new), new.info()["free_sites"]) == (0, 0)


def test_points_at_the_sensor() -> None:
    """Rays of no length pass nothing."""
    at = np.array(PLACES[0])
    made = built([LabelledCloud(np.tile(at, (5, 1)), SIX, np.zeros(5, np.int32), T_world_sensor=pose(at))])
    assert made.info()["free_sites"] == 1
    assert len(made.free_positions) == 0
    np.testing.assert_allclose(made.occupied_positions, [at], atol=1e-8)


class TestSettings:
    @pytest.mark.parametrize(
        "bad",
        [
            {"rays": 0}, {"rays": 2.5}, {"rays": "many"}, {"thin": 0}, {"thin": -1}, {"thin": 1.5},
            {"weight": 0.0}, {"weight": np.nan}, {"weight": -0.5}, {"weight": "1"}, {"weight": None},
            {"margin": 0.0}, {"margin": np.inf}, {"near": -1.0}, {"near": np.nan},
            {"reach": 0.0}, {"reach": -5.0}, {"reach": np.inf}, {"reach": np.nan}, {"reach": "far"},
            {"seed": -1}, {"seed": 0.5}, {"seed": None},
        ],
        ids=str,
    )  # fmt: skip
    def test_out_of_range(self, bad: dict[str, Any]) -> None:
        with pytest.raises(InputError, match=next(iter(bad))):
            FreeSpace(**bad)

    @pytest.mark.parametrize("bad", [{"weight": 1e7}, {"weight": 1e-5}, {"seed": 2**64}, {"thin": 2**64}], ids=str)
    def test_of_no_use(self, bad: dict[str, Any]) -> None:
        with pytest.raises(InputError, match=next(iter(bad))):
            FreeSpace(**bad)

    @pytest.mark.parametrize(
        "free",
        [
            FreeSpace(occupancy_model(0.2)),
            FreeSpace(BlockModel(resolution=EDGE, features=("red",))),
            FreeSpace(replace(occupancy_model(EDGE), other=True)),
        ],
        ids=["resolution", "features", "other"],
    )
    def test_models_that_do_not_fit(self, free: FreeSpace) -> None:
        with pytest.raises(InputError, match=r"occupancy_model\(resolution\)"):
            GPSemanticMap(SIX, MODEL, free=free)

    def test_a_prior_for_two_classes(self) -> None:
        three = FreeSpace(replace(occupancy_model(EDGE), prior=(0.2, 0.3, 0.5)))
        with pytest.raises(InputError, match="3 classes, the map has 2"):
            GPSemanticMap(SIX, MODEL, free=three)
        two = FreeSpace(replace(occupancy_model(EDGE), prior=(0.9, 0.1)))
        assert GPSemanticMap(SIX, MODEL, free=two).occupancy(queries(1)).probability[0] < 0.2

    def test_the_paper_s_map_keeps_no_free_space(self) -> None:
        with pytest.raises(InputError, match="BlockModel"):
            GPSemanticMap(SIX, GPModel(n_inducing=20), free=FREE_SPACE)

    @pytest.mark.parametrize("make", [lambda: built(room()[:1], free=None), lambda: GPSemanticMap(SIX, GPModel())])
    def test_maps_without_free_space_say_so(self, make: Callable[[], GPSemanticMap]) -> None:
        made = make()
        assert made.free is None
        for ask in (
            lambda: made.occupancy(queries(1)),
            lambda: made.free_positions,
            lambda: made.occupied_positions,
        ):
            with pytest.raises(InputError, match="free=FreeSpace"):
                ask()

    def test_the_default_model_goes_with_the_resolution(self) -> None:
        for resolution in (0.05, 1 / 3):
            filled = FREE_SPACE.of_resolution(resolution)
            assert filled.model == occupancy_model(resolution)
            assert filled.of_resolution(resolution) == filled
            a, b = (occupancy_model(r).kernel.diag(np.zeros((1, 3))) for r in (resolution, 1.0))
            np.testing.assert_allclose(a, b)
            X = np.random.default_rng(0).normal(size=(9, 3))
            np.testing.assert_allclose(
                occupancy_model(resolution).kernel(X * resolution, X * resolution),
                occupancy_model(1.0).kernel(X, X),
            )

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_along_the_vertical_lengths_are_shorter(self, axis: int) -> None:
        kernel = occupancy_model(0.2, vertical=axis).kernel
        k = kernel(np.eye(3), np.zeros((1, 3)))[:, 0]
        assert np.argmin(k) == axis
        assert k[axis - 1] == k[axis - 2] == occupancy_model(0.2).kernel(np.eye(3), np.zeros((1, 3)))[0, 0]
        far = kernel(np.eye(3) * 2.0, np.zeros((1, 3)))[:, 0]
        assert far[axis] < 0.2 * far[axis - 1]

    @pytest.mark.parametrize(
        "free",
        [FREE_SPACE, FreeSpace(occupancy_model(0.2, 1), 5, 0.3, 2.0, 4.0, 2, 30.0, 7)],
        ids=["plain", "all"],
    )
    def test_json(self, free: FreeSpace) -> None:
        assert FreeSpace.from_json(json.loads(json.dumps(free.to_json()))) == free

    def test_json_of_numpy_s_numbers(self) -> None:
        free = FreeSpace(weight=cast("float", np.float32(0.25)), margin=cast("float", np.int64(2)))
        assert FreeSpace.from_json(json.loads(json.dumps(free.to_json()))) == FreeSpace(weight=0.25, margin=2.0)

    @pytest.mark.parametrize(
        "plain",
        [
            {},
            {"rays": 5},
            {"model": None, "colour": 3},
            {"model": None, "rays": -1},
            {"model": 3},
            [],
            None,
            "free",
        ],
        ids=str,
    )
    def test_json_that_is_none(self, plain: Any) -> None:
        with pytest.raises(InputError, match=r"settings|rays|model"):
            FreeSpace.from_json(plain)
