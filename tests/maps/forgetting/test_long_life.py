"""Maps that live long: what is forgotten is dropped, and a map of nothing goes on."""

from dataclasses import replace

import numpy as np
import pytest

from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.maps.forgetting import Forgetting
from semgp.prediction import FREE
from tests.maps.forgetting.scenes import (
    NEVER,
    QUICK,
    SENSOR,
    THING,
    THING_AT,
    WALL_AT,
    assert_same_masses,
    near,
    new,
    off,
    patch,
    scan,
    square,
    updated,
)


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
        X = square(THING_AT)
        assert not made.query(X).observed.any()
        assert (made.occupancy(X).state == FREE).all()

    def test_a_map_of_which_all_labels_are_forgotten_goes_on_living(self) -> None:
        made = updated(new(Forgetting(1e12, passed=0.01)), *[self.labels_of_the_thing_only(0.0, 3)] * 3)
        gone, elsewhere = self.labels_of_the_thing_only(None, 3), self.labels_of_the_thing_only(None, 3)
        elsewhere = replace(elsewhere, points=off(elsewhere.points, 20, 0, 0))
        elsewhere = replace(elsewhere, T_world_sensor=scan(sensor=off(SENSOR, 20, 0, 0)).T_world_sensor)
        updated(made, *[gone, elsewhere] * 9)
        assert made.positions.shape == (0, 3)
        x = made.occupied_positions[:, 0] - WALL_AT[0]
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
        a, b = (updated(new(QUICK, reach=30.0), *start, *clouds[1:]) for start in (first, last))
        assert_same_masses(a, b)
        np.testing.assert_array_equal(a.to_arrays()[1]["origin"], a.to_arrays()[1]["free.origin"])

    @pytest.mark.parametrize(("confidence", "kept"), [(1 / 32, True), (1 / 128, False)])
    def test_faint_sites_have_no_position(self, confidence: float, kept: bool) -> None:
        made = updated(new(NEVER), patch((3.0, 1.0, 1.0), (1.0, 1.0, 1.0), 1, confidence=np.full(1, confidence)))
        assert len(made.positions) == kept
        assert len(made) == 1
