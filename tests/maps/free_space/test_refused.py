"""Updates and questions that are refused leave a map as it was."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps import occupancy
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.rays import free_samples
from tests.maps.free_space.scenes import (
    FREE_SPACE,
    MODEL,
    PLACES,
    SIX,
    assert_same_sites,
    built,
    moved,
    pose,
    room,
    scan,
    sites_of,
)

F64 = NDArray[np.float64]


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
