"""The synthetic building: its plan, its scans and where a robot fits, against geometry written down again here."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.checks import rigid_transform
from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.octomap import SemanticOctoMap
from semgp.prediction import FREE
from semgp.scene.building import MAST, ROBOT_HEIGHT, SyntheticBuilding
from semgp.scene.floorplan import BUILDING_CLASSES, HEIGHT, LENGTH, MISTAKEN_FOR, WIDTH
from semgp.scene.lidar import Lidar, PatchFaults
from tests.scene.solids import level

Array = NDArray[np.float64]

EXACT = Lidar(beams=16, columns=90, top=30, bottom=-30, reach=6, noise=0)
RIGHT = PatchFaults(wrong=0)
RADIUS = 0.25


def exact(seed: int) -> SyntheticBuilding:
    """Return a building whose scans have neither noise nor wrong labels."""
    return SyntheticBuilding(seed, EXACT, RIGHT)


def occupied(building: SyntheticBuilding, points: Array) -> NDArray[np.bool_]:
    """Return which points lie in one of the things."""
    inside = np.zeros(len(points), dtype=bool)
    for thing in building.plan.things:
        for solid in thing.solids:
            inside |= level(solid, points) < 1
    return inside


@pytest.mark.parametrize("seed", range(8))
def test_rooms_lie_side_by_side_and_differ_in_size(seed: int) -> None:
    rooms = SyntheticBuilding(seed).plan.rooms
    assert 9 <= len(rooms) <= 11
    area = [(room.x[1] - room.x[0]) * (room.y[1] - room.y[0]) for room in rooms]
    assert sum(area) == pytest.approx(LENGTH * WIDTH)
    assert max(area[1:]) > 1.5 * min(area[1:])
    for room in rooms:
        assert 0 <= room.x[0] < room.x[1] <= LENGTH + 1e-9
        assert 0 <= room.y[0] < room.y[1] <= WIDTH + 1e-9
        assert min(room.x[1] - room.x[0], room.y[1] - room.y[0]) > 1.5
    assert not any(a.grown(-1e-9).overlaps(b) for a, b in combinations(rooms, 2))


@pytest.mark.parametrize("seed", range(8))
def test_the_robot_gets_into_every_room_and_nearly_wherever_it_fits(seed: int) -> None:
    building = SyntheticBuilding(seed)
    reached = building.reachable(RADIUS, spacing=0.2)
    for room in building.plan.rooms:
        inside = ((reached > (room.x[0], room.y[0])) & (reached < (room.x[1], room.y[1]))).all(axis=1)
        assert inside.sum() * 0.04 > 0.25 * (room.x[1] - room.x[0]) * (room.y[1] - room.y[0])
    assert building.is_free(reached, RADIUS).all()
    grid = np.stack(np.meshgrid(np.arange(0.1, LENGTH, 0.2), np.arange(0.1, WIDTH, 0.2)), axis=-1).reshape(-1, 2)
    assert len(reached) > 0.95 * building.is_free(grid, RADIUS).sum()


def test_all_classes_stand_in_the_building_and_can_be_seen() -> None:
    surfaces = exact(1).surfaces(RADIUS, resolution=0.2)
    count = np.bincount(surfaces.hard_labels, minlength=len(BUILDING_CLASSES))
    assert (count > 20).all()
    assert count[BUILDING_CLASSES.index("wall")] > 0.2 * len(surfaces)


def test_a_place_is_free_where_no_thing_is_within_the_radius_at_the_height_of_the_robot() -> None:
    building = SyntheticBuilding(2)
    rng = np.random.default_rng(0)
    places = rng.uniform((-1, -1), (LENGTH + 1, WIDTH + 1), (80, 2))
    angle, z = np.linspace(0, 2 * np.pi, 16, endpoint=False), np.array([0.05, 0.2, 0.45, 0.72, 0.9, ROBOT_HEIGHT])
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for radius in (0.1, 0.4):
        discs = np.vstack([share * radius * ring for share in (0, 0.4, 0.7, 0.9, 0.999)])
        body = np.concatenate([np.repeat(discs, len(z), axis=0), np.tile(z, len(discs))[:, None]], axis=1)
        cylinders = (np.insert(places, 2, 0, axis=1)[:, None] + body).reshape(-1, 3)
        touched = occupied(building, cylinders).reshape(len(places), -1).any(axis=1)
        outside = ((places < 0) | (places > (LENGTH, WIDTH))).any(axis=1)
        free = building.is_free(places, radius)
        assert not free[touched | outside].any()
        missed = ~free & ~touched & ~outside  # what lies between the samples, or beside the lower half of a plant
        assert missed.sum() < 0.05 * len(places)
        assert free.sum() > 0.2 * len(places)


def test_points_lie_on_things_of_their_class_and_in_nothing() -> None:
    building = exact(3)
    reached = building.reachable(RADIUS, spacing=0.3)
    for i in (0, len(reached) // 2, len(reached) - 1):
        cloud = building.scan(building.pose(reached[i], heading=1.0))
        assert cloud.T_world_sensor is not None
        off_own_class = np.full(len(cloud), np.inf)
        for thing in building.plan.things:
            own = cloud.labels == BUILDING_CLASSES.index(thing.name)
            for solid in thing.solids:
                depth = level(solid, cloud.points)
                assert (depth > 1 - 1e-6).all()
                off_own_class[own] = np.minimum(off_own_class, np.abs(depth - 1))[own]
        assert off_own_class.max() < 1e-6
        distance = np.linalg.norm(cloud.points - cloud.T_world_sensor[:3, 3], axis=1)
        assert distance.max() <= EXACT.reach
        assert 0.5 * 16 * 90 < len(cloud) < 16 * 90  # most rays meet something, some are too long


def test_nothing_is_seen_from_the_entrance_but_the_building() -> None:
    building = exact(0)
    points = building.scan(building.pose(building.entrance)).points
    assert (points > -0.1).all()
    assert (points < np.array([LENGTH, WIDTH, HEIGHT]) + 0.1).all()
    corridor = building.plan.rooms[0]
    assert points[:, 2].min() == pytest.approx(0)
    assert points[:, 2].max() == pytest.approx(HEIGHT)
    assert (points[:, 1] < corridor.y[0] - 0.5).any()  # through a door that stands open


def test_rays_pass_free_space_only() -> None:
    building = exact(4)
    cloud = building.scan(building.pose(building.entrance))
    assert cloud.origin is not None
    share = np.random.default_rng(0).uniform(0, 0.999, (len(cloud), 1))
    assert not occupied(building, cloud.origin + share * (cloud.points - cloud.origin)).any()
    semantic_map = SemanticOctoMap(building.classes, resolution=0.2)
    semantic_map.update(cloud)
    x, y = building.entrance
    occupancy = semantic_map.query([[x + 0.6, y, MAST]]).occupancy
    assert occupancy is not None
    assert occupancy.state[0] == FREE


def test_surfaces_are_those_of_exact_scans_thinned() -> None:
    building = exact(5)
    surfaces = building.surfaces(RADIUS, resolution=0.25)
    cells = np.floor(surfaces.points / 0.25).astype(int)
    assert len(np.unique(cells, axis=0)) == len(cells)
    known = {tuple(cell) for cell in cells}
    reached = building.reachable(RADIUS)
    seen = []
    for i in np.linspace(0, len(reached) - 1, 6).astype(int):
        scan = np.floor(building.scan(building.pose(reached[i])).points / 0.25).astype(int)
        seen += [tuple(cell) in known for cell in scan]
    assert np.mean(seen) > 0.85
    depth = np.full(len(surfaces), np.inf)
    for thing in building.plan.things:
        own = surfaces.labels == BUILDING_CLASSES.index(thing.name)
        for solid in thing.solids:
            depth[own] = np.minimum(depth, np.abs(level(solid, surfaces.points) - 1))[own]
    assert depth.max() < 1e-6


def test_scans_are_the_same_at_every_call_and_differ_by_seed_number_and_place() -> None:
    building = SyntheticBuilding(6)
    T = building.pose(building.entrance)
    first, again = building.scan(T, 3), SyntheticBuilding(6).scan(T, 3)
    np.testing.assert_array_equal(first.points, again.points)
    np.testing.assert_array_equal(first.labels, again.labels)
    np.testing.assert_array_equal(first.T_world_sensor, T)
    other = SyntheticBuilding(7)
    elsewhere = building.pose(building.entrance + np.array([0.5, 0.0]))
    for scan in (building.scan(T, 4), building.scan(elsewhere, 3), other.scan(other.pose(other.entrance), 3)):
        assert scan.points.shape != first.points.shape or not np.array_equal(scan.points, first.points)


def test_labels_are_wrong_as_often_as_asked_and_for_classes_that_look_alike() -> None:
    building = SyntheticBuilding(0, faults=PatchFaults(wrong=0.2, missing=0.1))
    true = SyntheticBuilding(0, faults=RIGHT)
    T = building.pose(building.entrance)
    given = np.concatenate([building.scan(T, i).hard_labels for i in range(0, 60, 6)])
    truth = np.concatenate([true.scan(T, i).hard_labels for i in range(0, 60, 6)])
    missing = given == MISSING
    assert missing.mean() == pytest.approx(0.1, abs=0.04)
    assert (given != truth)[~missing].mean() == pytest.approx(0.2, abs=0.05)
    wrong = ~missing & (given != truth)
    assert (MISTAKEN_FOR[truth[wrong]] == given[wrong, None]).any(axis=1).all()
    assert (np.arange(len(BUILDING_CLASSES))[:, None] != MISTAKEN_FOR).all()


def test_poses_stand_upright_at_the_place_and_look_along_the_heading() -> None:
    building = SyntheticBuilding()
    T = rigid_transform("pose", building.pose((3.0, 4.0), heading=np.pi / 2))
    np.testing.assert_allclose(T[:3, 3], (3, 4, MAST))
    np.testing.assert_allclose(T[:3, 0], (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(T[:3, 2], (0, 0, 1))


def tilted(building: SyntheticBuilding) -> Array:
    T = building.pose(building.entrance)
    T[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return T


@pytest.mark.parametrize(
    ("act", "match"),
    [
        (lambda b: SyntheticBuilding(-1), "seed"),
        (lambda b: SyntheticBuilding(0.5), "seed"),  # type: ignore[arg-type]
        (lambda b: b.pose((1, 2, 3)), "shape"),
        (lambda b: b.pose((np.nan, 2)), "NaN"),
        (lambda b: b.pose((1, 2), heading=np.inf), "heading"),
        (lambda b: b.scan(tilted(b)), "upright"),
        (lambda b: b.scan(np.eye(3)), "T_world_sensor"),
        (lambda b: b.scan(b.pose((-2, 7))), "cannot stand"),
        (lambda b: b.scan(b.pose((5e6, 5e6))), "cannot stand"),
        (lambda b: b.scan(b.pose((0.0, 7.0))), "cannot stand"),
        (lambda b: b.scan(b.pose(b.entrance), -1), "number"),
        (lambda b: b.scan(b.pose(b.entrance), 0.5), "number"),
        (lambda b: b.is_free([[1.0, 2.0, 3.0]], 0.2), "shape"),
        (lambda b: b.is_free([[1.0, np.nan]], 0.2), "NaN"),
        (lambda b: b.is_free([[1.0, 2.0]], -0.2), "radius"),
        (lambda b: b.is_free([[1.0, 2.0]], np.nan), "radius"),
        (lambda b: b.reachable(5.0), "does not fit"),
        (lambda b: b.reachable(0.2, spacing=0.0), "spacing"),
        (lambda b: b.surfaces(0.2, resolution=-0.1), "resolution"),
    ],
)
def test_bad_input_is_refused(act: Callable[[SyntheticBuilding], object], match: str) -> None:
    with pytest.raises(InputError, match=match):
        act(SyntheticBuilding(0, EXACT))


def test_no_places_are_no_places() -> None:
    assert SyntheticBuilding().is_free(np.empty((0, 2)), 0.2).shape == (0,)
