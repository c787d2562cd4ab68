"""Maps saved, asked or cut on the way forget as the others do."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.cells import cell_keys
from semgp.maps.files import load_map, save_map
from semgp.maps.forgetting import Forgetting
from semgp.maps.gp import GPSemanticMap
from semgp.parallel import n_workers
from tests.maps.forgetting.scenes import (
    EDGE,
    QUICK,
    SENSOR,
    THING_AT,
    masses,
    near,
    new,
    off,
    patch,
    scan,
    updated,
)


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


class TestGoingOn:
    """A map saved, asked or cut on the way goes on as if it had not been."""

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
        part = updated(new(QUICK), *clouds[:3]).crop(off(SENSOR, 1.2, -5, -5), off(SENSOR, 1.8, 5, 5))
        whole = updated(new(QUICK), *clouds)
        updated(part, *clouds[3:])
        thing = {v: m for v, m in masses(whole, "free.").items() if near(np.array([v]) * EDGE, THING_AT, 0.2)}
        assert len(thing) > 30
        assert {v: m for v, m in masses(part, "free.").items() if v in thing} == thing

    @pytest.mark.skipif(
        not hasattr(os, "sched_setaffinity") or n_workers() < 2, reason="needs two cores to compare with"
    )
    def test_any_number_of_threads(self) -> None:
        cores = os.sched_getaffinity(0)
        clouds = [scan(0.1 * i, i) for i in range(6)]
        many = updated(new(QUICK), *clouds)
        try:
            os.sched_setaffinity(0, {min(cores)})
            one = updated(new(QUICK), *clouds)
        finally:
            os.sched_setaffinity(0, cores)
        assert_same(many, one)
