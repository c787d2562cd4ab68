"""Nothing but the data decides: neither order, frame, threads nor when a map is asked."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semgp.blocks.model import BlockModel
from semgp.maps.files import load_map, save_map
from semgp.maps.free_space import FreeSpace, occupancy_model
from semgp.maps.gp import GPSemanticMap
from semgp.parallel import n_workers
from tests.maps.free_space.scenes import (
    EDGE,
    FREE_SPACE,
    MODEL,
    PLACES,
    SIX,
    assert_same,
    assert_same_sites,
    built,
    moved,
    occupancy_of,
    queries,
    room,
    scan,
    sites_of,
)


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
