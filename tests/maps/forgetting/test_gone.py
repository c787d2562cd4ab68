"""Things that have gone: rays that pass take away what once stood there."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from semgp.blocks.accumulate import MASS_UNIT
from semgp.blocks.cells import cell_origin
from semgp.cloud import LabelledCloud
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.occupancy import Occupancy
from semgp.maps.rays import Walk, free_samples
from semgp.prediction import FREE, OCCUPIED
from semgp.voxels import VoxelTable, voxel_indices, voxel_keys
from tests.maps.forgetting.scenes import (
    EDGE,
    NEVER,
    QUICK,
    SENSOR,
    THING,
    THING_AT,
    TWO,
    WALL,
    WALL_AT,
    assert_same_masses,
    masses,
    near,
    new,
    patch,
    scan,
    square,
    updated,
)


class TestGone:
    """A thing that stood in mid-air for five scans, and then does not."""

    def seen_and_gone(self, forgetting: Forgetting | None, **free: Any) -> GPSemanticMap:
        there = [scan(0.0, seed) for seed in range(5)]
        return updated(new(forgetting, **free), *there, *[scan(None, 10 + seed) for seed in range(5)])

    @pytest.mark.parametrize(
        "free", [{}, {"thin": 2**30, "near": 0.5}, {"seed": 3, "weight": 0.3}], ids=["plain", "thin", "light"]
    )
    def test_no_ghost_stays(self, free: dict[str, Any]) -> None:
        made, keeps = (self.seen_and_gone(forgetting, **free) for forgetting in (QUICK, None))
        thing, wall = square(THING_AT), square(WALL_AT)
        assert near(keeps.occupied_positions, THING_AT, 0.25).sum() == 25  # a map that forgets nothing: a ghost
        assert (keeps.occupancy(thing).state == OCCUPIED).mean() > 0.9
        assert (keeps.query(thing).label == THING).all()

        assert near(made.occupied_positions, THING_AT, 0.25).sum() == 0
        assert (made.occupancy(thing).state == FREE).all()
        assert near(made.positions, THING_AT, 0.25).sum() == 0
        assert (made.query(thing).label != THING).all()

        assert (made.occupancy(wall).state == OCCUPIED).all()
        assert (made.query(wall).label == WALL).all()
        seen = near(keeps.occupied_positions, WALL_AT).sum()
        assert near(made.occupied_positions, WALL_AT).sum() == seen > 30

    def test_by_default_labels_follow_more_slowly(self) -> None:
        made = self.seen_and_gone(Forgetting(1000.0))
        assert near(made.occupied_positions, THING_AT, 0.25).sum() == 0
        assert (made.query(square(THING_AT)).label == THING).all()
        updated(made, *[scan(None, 20 + seed) for seed in range(10)])
        assert (made.query(square(THING_AT)).label != THING).all()
        assert (made.query(square(WALL_AT)).label == WALL).all()

    def test_many_labels_are_forgotten_as_few_are(self) -> None:
        """A camera puts many points into a voxel, of which one counts as occupied."""
        dense = [c[np.tile(np.arange(len(c)), 5)] for c in (scan(0.0), scan())]
        made = updated(new(Forgetting(1e12)), *[dense[0]] * 5, *[dense[1]] * 40)
        assert near(made.positions, THING_AT, 0.25).sum() == 0

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
            v for v, m in of_space.items() if m[1] and v in walked and near(np.array([v]) * EDGE, THING_AT)
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

        made = updated(new(QUICK), *[level(True)] * 5, *[level(False)] * 5)
        assert near(made.occupied_positions, (1.73, 3.027, 0.3)).sum() == 0
