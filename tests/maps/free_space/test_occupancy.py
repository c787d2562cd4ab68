"""What is free, occupied and unknown, and what a map says of itself."""

import json

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.cells import CELL
from semgp.cloud import LabelledCloud
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.prediction import FREE, OCCUPIED, UNKNOWN
from tests.maps.free_space.scenes import (
    EDGE,
    FREE_SPACE,
    HIGH,
    LOW,
    MODEL,
    PLACES,
    SIX,
    built,
    occupancy_of,
    pose,
    queries,
    room,
    sites_of,
)

F64 = NDArray[np.float64]


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


def test_points_at_the_sensor() -> None:
    """Rays of no length pass nothing."""
    at = np.array(PLACES[0])
    made = built([LabelledCloud(np.tile(at, (5, 1)), SIX, np.zeros(5, np.int32), T_world_sensor=pose(at))])
    assert made.info()["free_sites"] == 1
    assert len(made.free_positions) == 0
    np.testing.assert_allclose(made.occupied_positions, [at], atol=1e-8)
