"""Forgetting: half-lives, things that have gone, and what does not change."""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from semgp.blocks.accumulate import MASS_UNIT
from semgp.blocks.cells import cell_keys, cell_origin
from semgp.blocks.model import BlockModel
from semgp.blocks.observations import Observations
from semgp.blocks.sites import Sites
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.gp.model import GPModel
from semgp.maps.files import load_map, save_map
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.occupancy import Occupancy
from semgp.maps.rays import Walk, free_samples
from semgp.parallel import n_workers
from semgp.prediction import FREE, OCCUPIED
from semgp.voxels import VoxelTable, voxel_indices, voxel_keys

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

TWO = Classes(("wall", "thing"))
WALL, THING = 0, 1
EDGE = 0.1
MODEL = BlockModel(resolution=EDGE)
SENSOR = np.array([0.213, 3.027, 3.041])
NEVER = Forgetting(1e12, passed=1.0)


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


def stored(made: GPSemanticMap) -> dict[str, NDArray[Any]]:
    """What is stored, but for cells without sites: queries make some."""
    arrays = dict(made.to_arrays()[1])
    np.testing.assert_array_equal(arrays["origin"], arrays["free.origin"])
    for prefix in ("", "free."):
        cells, time = arrays.pop(prefix + "cells"), arrays.pop(prefix + "time")
        with_sites = np.isin(cells, cell_keys(arrays[prefix + "voxels"]))
        order = np.argsort(cells[with_sites])
        arrays[prefix + "cells"], arrays[prefix + "time"] = (a[with_sites][order] for a in (cells, time[:-1]))
        arrays[prefix + "now"] = time[-1]
    return arrays


def assert_same(a: GPSemanticMap, b: GPSemanticMap) -> None:
    """To the last bit: all that is stored, and answers."""
    arrays, other = stored(a), stored(b)
    assert arrays.keys() == other.keys()
    for name in arrays:
        np.testing.assert_array_equal(arrays[name], other[name], err_msg=name)
    X = SENSOR + np.random.default_rng(1).uniform((-0.5, -2, -2), (4, 2, 2), (2000, 3))
    np.testing.assert_array_equal(a.query(X).probability, b.query(X).probability)
    np.testing.assert_array_equal(a.occupancy(X).probability, b.occupancy(X).probability)


class TestSites:
    """Fading itself, on sites."""

    def made(self, n: int = 200) -> Sites:
        rng = np.random.default_rng(3)
        sites = Sites(3, 1, EDGE)
        weights = (rng.random((n, 3)) * rng.choice([0.5, 5, 50], (n, 1))).astype(np.float32)
        features = rng.normal(size=(n, 1)).astype(np.float32)
        draws = np.ones(n, np.int64)
        sites.add(
            Observations(
                rng.uniform(0, 18, (n, 3)), None, weights, features, None, rng.random((n, 3)) * 0.01, draws
            )
        )
        return sites

    @pytest.mark.parametrize("half_life", [1.0, 3.0, 10.0, 64.0])
    @pytest.mark.parametrize("at_once", [False, True])
    def test_half_of_the_mass_after_a_half_life(self, half_life: float, at_once: bool) -> None:
        sites = self.made()
        before = sites.mass.astype(float)
        cells = np.arange(len(sites.cells))
        assert len(cells) > 8
        for step in range(0 if at_once else int(half_life)):
            sites.clock = step + 1.0
            sites.fade(cells, half_life)
        sites.clock = half_life
        sites.fade(cells, half_life)
        rounding = 0.51 if at_once else 0.5 / (1 - 0.5 ** (1 / half_life)) + 0.51
        assert np.abs(sites.mass - before / 2).max() <= rounding

    @pytest.mark.parametrize("half_life", [3000, 10_000])
    def test_long_half_lives_in_short_steps(self, half_life: int) -> None:
        """Ten scans a second, ten minutes: labels must fade all the same."""
        sites = Sites(1, 0, EDGE)
        points = np.array([[0.05, 0.05, 0.05], [0.15, 0.05, 0.05], [0.25, 0.05, 0.05]])
        sites.add(
            Observations(points, None, np.array([[0.5], [1.0], [4.0]], np.float32), np.empty((3, 0), np.float32))
        )
        before = sites.mass.astype(float)
        for step in range(half_life):
            sites.clock = step + 1.0
            sites.fade(np.array([0]), half_life)
        np.testing.assert_allclose(sites.mass, before / 2, rtol=0.1)

    def test_what_stays(self) -> None:
        """Positions, features, variances and, to rounding, shares."""
        sites = self.made()
        where, mass, place, spread = sites.positions, sites.mass, sites.place.copy(), sites.spread.copy()
        share, total = mass / mass.sum(axis=1, keepdims=True), mass.sum(axis=1, dtype=float)
        sites.clock = 2.0
        sites.fade(np.arange(len(sites.cells)), 1.0)
        now = sites.mass.sum(axis=1, dtype=float)
        heavy = total > MASS_UNIT
        np.testing.assert_allclose(now[heavy], total[heavy] / 4, rtol=2e-3)
        np.testing.assert_allclose(sites.positions, where, atol=1e-7 * EDGE)
        np.testing.assert_allclose(sites.place[:, 3] / now, place[:, 3] / total, atol=1)
        np.testing.assert_allclose(sites.spread[:, :3] / now[:, None], spread[:, :3] / total[:, None], atol=1)
        np.testing.assert_array_equal(sites.spread[:, 3], spread[:, 3])
        np.testing.assert_allclose((sites.mass / now[:, None])[heavy], share[heavy], atol=2e-3)

    def test_a_trace_stays_of_the_most_probable_class(self) -> None:
        sites = self.made()
        top = sites.mass.argmax(axis=1)
        sites.clock = 200.0
        sites.fade(np.arange(len(sites.cells)), 1.0)
        assert (sites.mass.max(axis=1) == 1).all()
        assert (sites.mass[np.arange(len(sites)), top] == 1).all()

    def test_a_trace_stays_in_its_place(self) -> None:
        sites = self.made()
        where = sites.positions
        for step in (40.0, 200.0, 300.0):
            sites.clock = step
            sites.fade(np.arange(len(sites.cells)), 1.0)
            assert (sites.mass.sum(axis=1) >= 1).all()
            np.testing.assert_allclose(sites.positions, where, atol=1e-6 * EDGE)

    def test_cells_fade_by_themselves(self) -> None:
        sites = self.made()
        before, cell = sites.mass.copy(), sites.cells.find(cell_keys(sites.voxels.keys))
        sites.clock = 1.0
        sites.fade(np.array([2, 5]), 1.0)
        faded = np.isin(cell, [2, 5])
        assert 0 < faded.sum() < len(sites)
        np.testing.assert_array_equal(sites.mass[~faded], before[~faded])
        assert (sites.mass[faded].sum(axis=1) < 0.51 * before[faded].sum(axis=1)).all()
        sites.clock = 2.0
        sites.fade(np.arange(len(sites.cells)), 1.0)  # each for all the time since it last did
        np.testing.assert_allclose(sites.mass, before / 4, atol=1.0)

    def test_a_new_cell_does_not_fade_for_the_time_before_it(self) -> None:
        sites = Sites(1, 0, EDGE)
        sites.clock = 100.0
        sites.add(Observations(np.zeros((1, 3)), np.zeros(1, np.int32), None, np.empty((1, 0), np.float32)))
        sites.clock = 101.0
        sites.fade(np.array([0]), 1.0)
        assert sites.mass.tolist() == [[MASS_UNIT // 2]]

    def test_single_sites(self) -> None:
        sites = self.made()
        before, where = sites.mass.copy(), sites.positions
        rows = np.array([3, 50, 51, 117])
        sites.drift[:] = 0
        cells = sites.fade_sites(rows, 0.25)
        np.testing.assert_allclose(sites.mass[rows], before[rows] / 4, atol=0.51)
        np.testing.assert_array_equal(np.delete(sites.mass, rows, axis=0), np.delete(before, rows, axis=0))
        np.testing.assert_allclose(sites.positions, where, atol=1e-7 * EDGE)
        assert sites.drift.sum() == pytest.approx(4 * 0.75 / 2)
        assert cells.tolist() == np.flatnonzero(sites.drift).tolist()


class TestHalfLife:
    """One patch in a cell is seen once, another one in the same cell again and again."""

    HERE, THERE, EYE = np.array([4.0, 1.5, 1.5]), np.array([1.5, 4.0, 1.5]), np.array([1.5, 1.5, 1.5])
    AWAY, OTHER_EYE = np.array([10.0, 1.5, 1.5]), np.array([7.6, 1.5, 1.5])

    def mass_near(self, made: GPSemanticMap, at: F64, prefix: str = "") -> I64:
        """Class mass (n, C) of the sites of a patch, in the order of voxels."""
        found = masses(made, prefix)
        return np.array([found[v] for v in sorted(found) if (np.abs(np.array(v) * EDGE - at) < 0.36).all()])

    @pytest.mark.parametrize("scans", [1, 4, 12])
    def test_in_scans(self, scans: int) -> None:
        made = updated(new(Forgetting(4.0)), patch(self.HERE, self.EYE))
        before = [self.mass_near(made, self.HERE, prefix) for prefix in ("", "free.")]
        assert [len(b) > 50 for b in before] == [True, True]
        updated(made, *[patch(self.THERE, self.EYE)] * scans)
        for prefix, mass in zip(("", "free."), before):
            now = self.mass_near(made, self.HERE, prefix)
            np.testing.assert_allclose(now, mass * 0.5 ** (scans / 4), atol=0.5 / (1 - 0.5**0.25) + 0.51)
        fresh = self.mass_near(made, self.THERE)
        once = self.mass_near(updated(new(None), patch(self.THERE, self.EYE)), self.THERE)
        np.testing.assert_allclose(fresh, once * sum(0.5 ** (i / 4) for i in range(scans)), atol=4 * scans)

    def test_in_seconds(self) -> None:
        made = updated(new(Forgetting(20.0, per="second")), patch(self.HERE, self.EYE, stamp=1.7e9))
        before = self.mass_near(made, self.HERE)
        for seconds in (0.0, 3.0, 10.0):
            updated(made, patch(self.THERE, self.EYE, stamp=1.7e9 + seconds))
        np.testing.assert_allclose(self.mass_near(made, self.HERE), before * 0.5 ** (10 / 20), atol=2)
        updated(made, patch(self.THERE, self.EYE, stamp=1.7e9 + 1e6))
        assert near(made.positions, self.HERE).sum() == 0 < near(made.positions, self.THERE).sum()

    def test_what_no_scan_comes_near_stays(self) -> None:
        made = updated(new(Forgetting(4.0)), patch(self.AWAY, self.OTHER_EYE))
        before = [self.mass_near(made, self.AWAY, prefix) for prefix in ("", "free.")]
        updated(made, *[patch(self.THERE, self.EYE)] * 9)
        for prefix, mass in zip(("", "free."), before):
            np.testing.assert_array_equal(self.mass_near(made, self.AWAY, prefix), mass)
        updated(made, patch(off(self.AWAY, -1.0, 2.5, 0), self.OTHER_EYE))  # and then fades for all that time
        for prefix, mass in zip(("", "free."), before):
            np.testing.assert_allclose(self.mass_near(made, self.AWAY, prefix), mass * 0.5 ** (10 / 4), atol=1)

    def test_labels_beyond_the_reach_of_rays(self) -> None:
        """Labels that come in again and again are young, however far away they were seen from."""
        made = updated(new(Forgetting(4.0), reach=2.0), *[patch(self.AWAY, self.EYE)] * 12)
        updated(made, patch(off(self.OTHER_EYE, 1.0, 0, 0), self.OTHER_EYE))
        once = self.mass_near(updated(new(None), patch(self.AWAY, self.EYE)), self.AWAY)
        expected = once * sum(0.5 ** (i / 4) for i in range(1, 13))
        np.testing.assert_allclose(self.mass_near(made, self.AWAY), expected, atol=50)


class TestGone:
    """A thing that stood in mid-air for five scans, and then does not."""

    AT = SENSOR + np.array([1.52, 0, 0])
    WALL_AT = SENSOR + np.array([3.03, 0, 0])
    QUICK = Forgetting(1000.0, passed=0.05)

    def on(self, at: F64) -> F64:
        """Points on a square of 40 cm."""
        y, z = np.meshgrid(*[np.linspace(-0.2, 0.2, 9)] * 2)
        return np.asarray(at + np.column_stack([np.zeros(81), y.ravel(), z.ravel()]))

    def seen_and_gone(self, forgetting: Forgetting | None, **free: Any) -> GPSemanticMap:
        there = [scan(0.0, seed) for seed in range(5)]
        return updated(new(forgetting, **free), *there, *[scan(None, 10 + seed) for seed in range(5)])

    @pytest.mark.parametrize(
        "free", [{}, {"thin": 2**30, "near": 0.5}, {"seed": 3, "weight": 0.3}], ids=["plain", "thin", "light"]
    )
    def test_no_ghost_stays(self, free: dict[str, Any]) -> None:
        made, keeps = (self.seen_and_gone(forgetting, **free) for forgetting in (self.QUICK, None))
        thing, wall = self.on(self.AT), self.on(self.WALL_AT)
        assert near(keeps.occupied_positions, self.AT, 0.25).sum() == 25  # a map that forgets nothing: a ghost
        assert (keeps.occupancy(thing).state == OCCUPIED).mean() > 0.9
        assert (keeps.query(thing).label == THING).all()

        assert near(made.occupied_positions, self.AT, 0.25).sum() == 0
        assert (made.occupancy(thing).state == FREE).all()
        assert near(made.positions, self.AT, 0.25).sum() == 0
        assert (made.query(thing).label != THING).all()

        assert (made.occupancy(wall).state == OCCUPIED).all()
        assert (made.query(wall).label == WALL).all()
        seen = near(keeps.occupied_positions, self.WALL_AT).sum()
        assert near(made.occupied_positions, self.WALL_AT).sum() == seen > 30

    def test_by_default_labels_follow_more_slowly(self) -> None:
        made = self.seen_and_gone(Forgetting(1000.0))
        assert near(made.occupied_positions, self.AT, 0.25).sum() == 0
        assert (made.query(self.on(self.AT)).label == THING).all()
        updated(made, *[scan(None, 20 + seed) for seed in range(10)])
        assert (made.query(self.on(self.AT)).label != THING).all()
        assert (made.query(self.on(self.WALL_AT)).label == WALL).all()

    def test_many_labels_are_forgotten_as_few_are(self) -> None:
        """A camera puts many points into a voxel, of which one counts as occupied."""
        dense = [c[np.tile(np.arange(len(c)), 5)] for c in (scan(0.0), scan())]
        made = updated(new(Forgetting(1e12)), *[dense[0]] * 5, *[dense[1]] * 40)
        assert near(made.positions, self.AT, 0.25).sum() == 0

    @pytest.mark.parametrize(("passed", "weight"), [(0.5, 0.5), (0.8, 0.25), (0.1, 2.0), (1.0, 1.0), (0.5, 2.5)])
    def test_scan_by_scan(self, passed: float, weight: float) -> None:
        """What was seen is multiplied; what is mostly free then loses labels; the scan says that it is free.

        The last: after two scans as often seen as passed, which is not mostly free.
        """
        made = updated(new(Forgetting(1e12, passed=passed), weight=weight), *[scan(0.0)] * 5)
        of_labels, of_space = masses(made), masses(made, "free.")
        table, walk = VoxelTable(), Walk(EDGE, np.zeros(3), 1e9, 0, EDGE, 3 * EDGE, 1, np.inf)
        gone = scan()
        _, keys, _ = free_samples(SENSOR, gone.points, walk, table, np.empty(0, dtype=bool))
        walked = set(map(tuple, voxel_indices(keys, (0, 0, 0)).tolist()))
        passed_things = [
            v for v, m in of_space.items() if m[1] and v in walked and near(np.array([v]) * EDGE, self.AT)
        ]
        assert len(passed_things) > 20
        state = {v: (0.0, 5.0 * MASS_UNIT, float(of_labels[v][THING])) for v in passed_things}
        for _ in range(12):
            made.update(gone)
            labels_now, space_now = masses(made), masses(made, "free.")
            for v, (free, occupied, label) in state.items():
                free, occupied = free * passed, occupied * passed
                label = label * passed if free > occupied else label
                state[v] = free + weight * MASS_UNIT, occupied, label
                if occupied < 4:  # steps of mass: next to nothing is left to see through
                    continue
                assert np.abs(np.array(space_now[v]) - state[v][:2]).max() <= 0.5 / (1 - min(passed, 0.9)) + 1
                assert abs(labels_now[v][THING] - label) <= 0.5 / (1 - min(passed, 0.9)) + 1

    def test_which_voxels_were_passed(self) -> None:
        """Those that were occupied and lie on a ray's way, but for those in which a ray ends."""
        space = Occupancy(FreeSpace(rays=2000).of_resolution(EDGE))
        origin, nothing = cell_origin(scan(0.0, 0).points, EDGE), np.empty(0, dtype=bool)
        space.field.sites.origin = origin
        for seed in range(3):
            space.add(space.sample(scan(0.0, seed), origin, nothing))
        occupied = set(space.field.sites.voxels.keys[space.field.sites.mass[:, OCCUPIED] > 0].tolist())
        oblique = scan(None, 7, sensor=SENSOR + np.array([0.9, -0.8, 0.1]))
        oblique = replace(oblique, points=np.concatenate([oblique.points[:1500], scan(0.0, 8).points[1500:]]))
        told = space.sample(oblique, origin, space.occupied(np.empty(0, dtype=np.int64)))
        assert oblique.origin is not None
        walk = Walk(EDGE, origin.astype(float), 2000 / 2500, 0, EDGE, 3 * EDGE, 1, np.inf)
        _, keys, _ = free_samples(oblique.origin, oblique.points, walk, VoxelTable(), np.empty(0, dtype=bool))
        ends = set(voxel_keys(oblique.points, EDGE, origin).tolist())
        walked = set(keys.tolist())
        assert len(occupied & walked & ends) > 5
        assert len(occupied & walked - ends) > 20
        assert sorted(told.passed.tolist()) == sorted(occupied & walked - ends)
        free = set(voxel_keys(told.points[told.labels == FREE], EDGE, origin).tolist())
        assert occupied & walked - ends <= free  # each of these samples counts
        assert len(space.sample(oblique, origin, nothing).passed) == 0

    def test_what_is_seen_again_is_not_given_up(self) -> None:
        """Rays graze a wall on the way along it: where others end, it stays."""
        along = patch((3.0, 1.0, 1.5), (0.5, 1.02, 1.5), n=2000)
        points = along.points.copy()
        points[:, 0] = np.random.default_rng(0).uniform(0.8, 5.0, 2000)
        points[:, 1] = 1.0 + 0.03 * np.random.default_rng(1).normal(size=2000)
        along = replace(along, points=points)
        assert_same_masses(
            updated(new(NEVER), *[along] * 6), updated(new(Forgetting(1e12, passed=0.01)), *[along] * 6)
        )

    def test_a_level_lidar_on_a_face_between_voxels(self) -> None:
        """At 0.3 m, in voxels of 0.1 m."""

        def level(thing: bool) -> LabelledCloud:
            T = np.eye(4)
            T[:3, 3] = (0.213, 3.027, 0.3)
            a = np.linspace(-0.45, 0.45, 500)
            t = np.where(thing & (np.abs(a) < 0.15), 1.52, 3.03)
            points = np.column_stack([0.213 + t, 3.027 + t * a, np.full(500, 0.3)])
            return LabelledCloud(points, TWO, (t < 2).astype(np.int32), T_world_sensor=T)

        made = updated(new(self.QUICK), *[level(True)] * 5, *[level(False)] * 5)
        assert near(made.occupied_positions, (1.73, 3.027, 0.3)).sum() == 0


def assert_same_masses(a: GPSemanticMap, b: GPSemanticMap) -> None:
    for prefix in ("", "free."):
        assert masses(a, prefix) == masses(b, prefix)


class TestNothingForgotten:
    """passed=1 and a half-life of ages change nothing but the samples in occupied voxels, which all count."""

    def clouds(self) -> list[LabelledCloud]:
        return [scan(0.0 if i < 2 else None, i) for i in range(5)]

    def test_all_samples_count(self) -> None:
        kept, same = (updated(new(f, thin=1), *self.clouds()) for f in (None, NEVER))
        assert_same_masses(kept, same)
        X = SENSOR + np.random.default_rng(1).uniform((-0.5, -2, -2), (4, 2, 2), (2000, 3))
        np.testing.assert_array_equal(kept.query(X).probability, same.query(X).probability)
        np.testing.assert_array_equal(kept.occupancy(X).probability, same.occupancy(X).probability)
        np.testing.assert_array_equal(kept.positions, same.positions)

    def test_few_samples_count(self) -> None:
        kept, same = (updated(new(f), *self.clouds()) for f in (None, NEVER))
        assert masses(kept) == masses(same)
        a, b = masses(kept, "free."), masses(same, "free.")
        assert a.keys() == b.keys()
        other = [v for v in a if a[v] != b[v]]
        assert len(other) > 10
        assert all(b[v][1] == a[v][1] > 0 and b[v][0] > a[v][0] for v in other)


class TestLongLife:
    def test_a_thing_that_moves_on_and_on(self) -> None:
        """Sites of places that it has left are dropped in time; a map that does not forget keeps them all."""
        way = [(0.3 * np.sin(0.5 * i), 0.8 + 1.8 * (i % 40) / 40) for i in range(60)]
        made, keeps = new(Forgetting(30.0, passed=0.05)), new(None)
        most = 0
        for i, (height, ahead) in enumerate(way):
            cloud = scan(height, i % 7, ahead=ahead)
            cloud = replace(cloud, labels=np.where(cloud.hard_labels == THING, THING, MISSING).astype(np.int32))
            for semantic_map in (made, keeps):
                semantic_map.update(cloud)
            most = max(most, len(made))
        live = len(updated(new(None), cloud))
        assert len(keeps) > 12 * live
        assert len(made.positions) < 4 * live
        assert most < 8 * live
        assert near(made.positions, off(SENSOR, way[-1][1], 0, way[-1][0]), 0.36).sum() >= live / 2

    def labels_of_the_thing_only(self, thing_at: float | None, seed: int) -> LabelledCloud:
        """A label for the middle of the thing only, which rays pass on all sides."""
        cloud = scan(thing_at, seed)
        middle = (cloud.hard_labels == THING) & near(cloud.points, off(SENSOR, 1.52, 0, thing_at or 0), 0.2)
        return replace(cloud, labels=np.where(middle, THING, MISSING).astype(np.int32))

    def test_forgotten_sites_are_dropped(self) -> None:
        made = new(Forgetting(1e12, passed=0.01))
        for i in range(9):
            made.update(self.labels_of_the_thing_only((-0.35, 0.35)[i > 2], i))
        places = [near(made.positions, off(SENSOR, 1.52, 0, at)).sum() for at in (-0.35, 0.35)]
        assert places[0] == 0
        assert 15 < places[1] <= len(made) <= 2 * places[1]

    def test_a_map_of_which_all_labels_are_forgotten(self) -> None:
        """It still answers, and still says that nothing is there."""
        made = new(Forgetting(1e12, passed=0.01))
        updated(made, *[self.labels_of_the_thing_only(0.0, 3)] * 3, *[self.labels_of_the_thing_only(None, 3)] * 9)
        assert made.positions.shape == (0, 3)
        X = TestGone().on(TestGone.AT)
        assert not made.query(X).observed.any()
        assert (made.occupancy(X).state == FREE).all()

    def test_a_map_of_which_all_labels_are_forgotten_goes_on_living(self) -> None:
        made = updated(new(Forgetting(1e12, passed=0.01)), *[self.labels_of_the_thing_only(0.0, 3)] * 3)
        gone, elsewhere = self.labels_of_the_thing_only(None, 3), self.labels_of_the_thing_only(None, 3)
        elsewhere = replace(elsewhere, points=off(elsewhere.points, 20, 0, 0))
        elsewhere = replace(elsewhere, T_world_sensor=scan(sensor=off(SENSOR, 20, 0, 0)).T_world_sensor)
        updated(made, *[gone, elsewhere] * 9)
        assert made.positions.shape == (0, 3)
        x = made.occupied_positions[:, 0] - TestGone.WALL_AT[0]
        assert np.minimum(np.abs(x), np.abs(x - 20)).max() < 1e-6
        arrays = made.to_arrays()[1]
        assert arrays["time"][-1] == arrays["free.time"][-1] == 21
        elsewhere = replace(elsewhere, labels=np.zeros(2500, np.int32))
        assert len(updated(made, elsewhere).positions) > 0
        np.testing.assert_array_equal(arrays["free.origin"], made.to_arrays()[1]["origin"])

    def test_all_old_labels_are_forgotten_as_new_ones_come(self) -> None:
        there, gone = (self.labels_of_the_thing_only(at, 3) for at in (0.0, None))
        for n in range(6):
            made = updated(new(Forgetting(1e12, passed=0.01)), *[there] * 3, *[gone] * n)
            elsewhere = patch((4.0, 20.0, 3.0), (2.0, 20.0, 3.0), 5)
            both = replace(
                gone,
                points=np.concatenate([gone.points, elsewhere.points]),
                labels=np.concatenate([gone.hard_labels, elsewhere.hard_labels]),
            )
            arrays = updated(made, both).to_arrays()[1]
            np.testing.assert_array_equal(arrays["origin"], arrays["free.origin"])

    def test_the_first_point_decides_nothing(self) -> None:
        """Not even where it lies beyond the reach, in another cell."""
        clouds = [scan(0.0 if i < 3 else None, i) for i in range(6)]
        far = patch((60.0, 3.0, 3.0), SENSOR, 5)
        both = (
            np.concatenate([far.points, clouds[0].points]),
            np.concatenate([far.hard_labels, clouds[0].hard_labels]),
        )
        first, last = ([replace(clouds[0], points=both[0][s], labels=both[1][s])] for s in (np.s_[:], np.s_[::-1]))
        a, b = (updated(new(TestGone.QUICK, reach=30.0), *start, *clouds[1:]) for start in (first, last))
        assert_same_masses(a, b)
        np.testing.assert_array_equal(a.to_arrays()[1]["origin"], a.to_arrays()[1]["free.origin"])

    def test_saved_without_labels_and_gone_on_with(self, tmp_path: Path) -> None:
        clouds = [scan(0.0 if i < 3 else None, i, labels=None) for i in range(5)] + [scan(None, 7)]
        straight, made = updated(new(Forgetting(3.0)), *clouds), updated(new(Forgetting(3.0)), *clouds[:3])
        save_map(made, tmp_path / "map.semgp")
        loaded = load_map(tmp_path / "map.semgp")
        assert isinstance(loaded, GPSemanticMap)
        assert_same(updated(loaded, *clouds[3:]), straight)

    def test_saved_at_the_time_0_and_gone_on_with(self, tmp_path: Path) -> None:
        made = updated(new(Forgetting(1.0, per="second")), scan(0.0, stamp=-8.0))
        updated(made, patch((3.0, 20.0, 3.0), (1.0, 20.0, 3.0), stamp=0.0))
        save_map(made, tmp_path / "map.semgp")
        loaded = load_map(tmp_path / "map.semgp")
        assert isinstance(loaded, GPSemanticMap)
        assert_same(*(updated(one, scan(0.0, 3, stamp=1.0)) for one in (made, loaded)))

    def test_a_part_without_anything_goes_on_living(self, tmp_path: Path) -> None:
        part = updated(new(Forgetting(5.0)), *[scan(0.0)] * 3).crop((100, 100, 100), (101, 101, 101))
        assert len(part) == 0
        save_map(updated(part, scan(0.0)), tmp_path / "map.semgp")
        loaded = load_map(tmp_path / "map.semgp")
        assert isinstance(loaded, GPSemanticMap)
        assert_same(loaded, part)

    @pytest.mark.parametrize(("confidence", "kept"), [(1 / 32, True), (1 / 128, False)])
    def test_faint_sites_have_no_position(self, confidence: float, kept: bool) -> None:
        made = updated(new(NEVER), patch((3.0, 1.0, 1.0), (1.0, 1.0, 1.0), 1, confidence=np.full(1, confidence)))
        assert len(made.positions) == kept
        assert len(made) == 1

    @pytest.mark.parametrize("after", [1, 4, 8])
    @pytest.mark.parametrize("per", ["scan", "second"])
    def test_saved_and_gone_on_with(self, after: int, per: str, tmp_path: Path) -> None:
        clouds = [scan(0.5 * (i // 3) if i % 5 else None, i, stamp=1e9 + 0.7 * i**2) for i in range(11)]
        clouds[6] = replace(scan(None, 6, sensor=SENSOR + np.array([20.0, 0, 0])), stamp=clouds[6].stamp)
        straight = updated(new(Forgetting(7.0, per, passed=0.3)), *clouds)
        made = updated(new(Forgetting(7.0, per, passed=0.3)), *clouds[:after])
        save_map(made, tmp_path / "map.semgp")
        loaded = load_map(tmp_path / "map.semgp")
        assert isinstance(loaded, GPSemanticMap)
        assert_same(loaded, made)
        assert_same(updated(loaded, *clouds[after:]), straight)

    def test_asked_on_the_way(self) -> None:
        """What fades, and what is given up, is solved again."""
        clouds = [scan(0.0), scan(0.0, 1), *[scan(None, i, labels=None) for i in (2, 3, 4)], scan(None, 5)]
        clouds += [patch((5.5, 1.0, 1.0), (5.0, 1.0, 1.0), labels=None)] * 2  # in the same cell
        made, asked = updated(new(Forgetting(3.0)), *clouds), new(Forgetting(3.0))
        X = SENSOR + np.random.default_rng(1).uniform((-0.5, -2, -2), (4, 2, 2), (2000, 3))
        for cloud in clouds:
            updated(asked, cloud).query(X)
        assert_same(made, asked)

    def test_a_part_forgets_as_the_whole_does(self) -> None:
        clouds = [scan(0.0 if i < 3 else None, i) for i in range(6)]
        part = updated(new(TestGone.QUICK), *clouds[:3]).crop(off(SENSOR, 1.2, -5, -5), off(SENSOR, 1.8, 5, 5))
        whole = updated(new(TestGone.QUICK), *clouds)
        updated(part, *clouds[3:])
        thing = {v: m for v, m in masses(whole, "free.").items() if near(np.array([v]) * EDGE, TestGone.AT, 0.2)}
        assert len(thing) > 30
        assert {v: m for v, m in masses(part, "free.").items() if v in thing} == thing

    @pytest.mark.skipif(
        not hasattr(os, "sched_setaffinity") or n_workers() < 2, reason="needs two cores to compare with"
    )
    def test_any_number_of_threads(self) -> None:
        cores = os.sched_getaffinity(0)
        clouds = [scan(0.1 * i, i) for i in range(6)]
        many = updated(new(TestGone.QUICK), *clouds)
        try:
            os.sched_setaffinity(0, {min(cores)})
            one = updated(new(TestGone.QUICK), *clouds)
        finally:
            os.sched_setaffinity(0, cores)
        assert_same(many, one)


class TestRefused:
    """Updates that are refused leave a map as it was, the time included."""

    def untouched(self, made: GPSemanticMap, cloud: LabelledCloud, message: str) -> None:
        before = {name: a.copy() for name, a in made.to_arrays()[1].items()}
        with pytest.raises(InputError, match=message):
            made.update(cloud)
        now = made.to_arrays()[1]
        assert now.keys() == before.keys()
        for name in now:
            np.testing.assert_array_equal(now[name], before[name], err_msg=name)

    def test_clouds_without_a_stamp(self) -> None:
        made = new(Forgetting(5.0, per="second"))
        self.untouched(made, scan(), "needs a stamp")
        self.untouched(updated(made, scan(stamp=3.0)), scan(), "needs a stamp")

    def test_clouds_out_of_order(self) -> None:
        made = updated(new(Forgetting(5.0, per="second")), scan(stamp=3.0), scan(stamp=3.0))
        self.untouched(made, scan(stamp=2.9), "in their order")

    def test_a_first_cloud_may_have_any_stamp(self) -> None:
        assert len(updated(new(Forgetting(5.0, per="second")), scan(stamp=-3.0), scan(stamp=-1.0))) > 0

    def test_scans_need_no_stamps(self) -> None:
        assert len(updated(new(Forgetting(5.0)), scan(stamp=3.0), scan(), scan(stamp=1.0))) > 0

    def test_clouds_without_a_pose(self) -> None:
        self.untouched(updated(new(Forgetting(5.0)), scan(0.0)), scan(T_world_sensor=None), "give its pose")

    def test_stray_points(self) -> None:
        stray = scan()
        stray.points[0] += 2e5
        self.untouched(updated(new(Forgetting(5.0)), scan(0.0)), stray, "drop stray points")

    def test_heavy_labels(self) -> None:
        heavy = scan(labels=None, weights=np.full((2500, 2), 65.0))
        self.untouched(updated(new(Forgetting(5.0)), scan(0.0)), heavy, "64 at most")

    def test_uncertain_positions_for_experts(self) -> None:
        model = BlockModel(resolution=EDGE, posterior="dirichlet")
        made = GPSemanticMap(TWO, model, free=FreeSpace(), forgetting=Forgetting(5.0))
        uncertain = scan(covariances=np.tile(np.eye(3) * 1e-4, (2500, 1, 1)))
        self.untouched(updated(made, scan(0.0)), uncertain, "take positions as certain")

    @pytest.mark.parametrize("stamp", [np.nan, np.inf])
    def test_stamps_that_are_none(self, stamp: float) -> None:
        with pytest.raises(InputError, match="stamp"):
            scan(stamp=stamp)

    @pytest.mark.parametrize("per", ["scan", "second"])
    def test_empty_clouds_take_no_time(self, per: str) -> None:
        made = updated(new(Forgetting(5.0, per)), scan(0.0, stamp=1.0))
        before = {name: a.copy() for name, a in made.to_arrays()[1].items()}
        updated(made, scan(stamp=9.0)[:0], scan()[:0])
        for name, array in made.to_arrays()[1].items():
            np.testing.assert_array_equal(array, before[name], err_msg=name)

    @pytest.mark.parametrize("damage", ["nan", "inf", "later than now", "cells twice", "no cells", "origins"])
    def test_damaged_files(self, damage: str, tmp_path: Path) -> None:
        made = updated(new(Forgetting(5.0)), scan(0.0), scan(sensor=off(SENSOR, 20, 0, 0)))

        class Damaged(GPSemanticMap):
            def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
                header, arrays = made.to_arrays()
                time, cells = arrays["time"].copy(), arrays["cells"].copy()
                if damage == "nan":
                    time[0] = np.nan
                elif damage == "inf":
                    time[-1] = np.inf
                elif damage == "later than now":
                    time[0] = time[-1] + 1
                elif damage == "cells twice":
                    cells[1:] = cells[0]
                elif damage == "no cells":
                    cells += 5
                else:
                    arrays["free.origin"] = arrays["free.origin"] + 64
                return header, arrays | {"time": time, "cells": cells}

        save_map(Damaged(TWO, MODEL), tmp_path / "map.semgp")
        with pytest.raises(FileFormatError, match="damaged"):
            load_map(tmp_path / "map.semgp")

    @pytest.mark.parametrize("name", ["time", "cells", "free.time"])
    def test_files_that_lack_something(self, name: str, tmp_path: Path) -> None:
        made = updated(new(Forgetting(5.0)), scan(0.0), scan())
        header, arrays = made.to_arrays()
        wrong: dict[str, NDArray[Any]] = {"time": arrays["time"][1:], "cells": arrays["cells"].astype(float)}
        wrong["free.time"] = arrays["free.time"].astype(int)
        with pytest.raises(InputError, match=name):
            GPSemanticMap.from_arrays(TWO, header, arrays | {name: wrong[name]})


class TestSettings:
    @pytest.mark.parametrize(
        "bad",
        [
            {"half_life": 0.0}, {"half_life": -1.0}, {"half_life": np.nan}, {"half_life": np.inf},
            {"half_life": "1"},
            {"passed": 0.0}, {"passed": -0.5}, {"passed": 1.01}, {"passed": np.nan},
            {"per": "minute"}, {"per": None},
        ],
        ids=str,
    )  # fmt: skip
    def test_out_of_range(self, bad: dict[str, Any]) -> None:
        with pytest.raises(InputError, match=next(iter(bad)).replace("per", "per 'scan' or per 'second'")):
            Forgetting(**({"half_life": 5.0} | bad))

    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: GPSemanticMap(TWO, MODEL, forgetting=NEVER), "free=FreeSpace"),
            (lambda: GPSemanticMap(TWO, GPModel(), forgetting=NEVER), "BlockModel"),
            (lambda: GPSemanticMap(TWO, GPModel(), free=FreeSpace(), forgetting=NEVER), "BlockModel"),
        ],
    )
    def test_maps_that_cannot_forget(self, make: Callable[[], object], message: str) -> None:
        with pytest.raises(InputError, match=message):
            make()

    @pytest.mark.parametrize("forgetting", [Forgetting(3.0), Forgetting(0.5, "second", 0.125)])
    def test_json(self, forgetting: Forgetting) -> None:
        assert Forgetting.from_json(json.loads(json.dumps(forgetting.to_json()))) == forgetting

    def test_json_of_numpy_s_numbers(self) -> None:
        forgetting = Forgetting(cast("float", np.int64(3)), passed=cast("float", np.float32(0.25)))
        assert Forgetting.from_json(json.loads(json.dumps(forgetting.to_json()))) == Forgetting(3.0, passed=0.25)

    @pytest.mark.parametrize(
        "plain",
        [{}, {"half_life": 1, "colour": 3}, {"half_life": "1"}, {"half_life": 1, "passed": "x"}, [], None],
        ids=str,
    )
    def test_json_that_is_none(self, plain: Any) -> None:
        with pytest.raises(InputError, match=r"settings|half_life"):
            Forgetting.from_json(plain)
