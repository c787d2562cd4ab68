"""Parts cut out of a map, and maps of points without labels, go on living."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.model import BlockModel
from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.maps.files import load_map, save_map
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from tests.maps.free_space.scenes import (
    EDGE,
    FREE_SPACE,
    MODEL,
    PLACES,
    SIX,
    assert_same,
    built,
    moved,
    occupancy_of,
    queries,
    room,
    scan,
)

F64 = NDArray[np.float64]


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
