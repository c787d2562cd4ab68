"""Ray casting against exact geometry, and against a march in small steps through whole rays."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from semgp.baselines.knn import KNNMap
from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.protocol import BATCH
from semgp.planning import raycast
from semgp.scene.raycast import cast
from tests.planning import naive
from tests.planning.box_world import CLASSES, FLOOR, TABLE, WALL, BoxWorld, room

EYE = np.array([1.0, 0.7, 1.2])


def directions(n: int, seed: int = 0) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(size=(n, 3))


def units(d: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


def test_distances_are_those_of_exact_geometry() -> None:
    world, d = room(), units(directions(3000))
    hits = raycast(world, EYE, d, max_range=6.0)
    exact = cast(world.solids(), EYE, d).distance
    ends = EYE + np.where(np.isfinite(exact), exact, 0)[:, None] * d
    seen = np.isfinite(exact) & (ends < world.seen[3:] - 0.01).all(axis=1)
    late = hits.distance[seen] - exact[seen]
    assert seen.sum() > 1000
    assert late.min() > -1e-9
    assert (late <= world.resolution / 16 + 1e-9).mean() > 0.99  # but for corners that are cut off
    assert not hits.met[~np.isfinite(exact)].any()


@pytest.mark.parametrize("threshold", [0.2, 0.5, 0.9])
def test_it_meets_what_a_march_through_the_whole_ray_meets(threshold: float) -> None:
    world, d = room(softness=0.03), directions(150, 1)
    origins = np.random.default_rng(2).uniform((0.3, 0.3, 0.9), (3.0, 2.7, 1.9), (150, 3))
    hits = raycast(world, origins, d, max_range=2.33, threshold=threshold)
    slow = [naive.first_surface(world, o, u, 2.33, threshold) for o, u in zip(origins, units(d))]
    np.testing.assert_allclose(hits.distance, slow, atol=1e-9)
    assert 30 < hits.met.sum() < 150


def test_what_is_met_is_described() -> None:
    world = room()
    down_table, down_floor, wall, up, into_unknown = (0, 0, -1), (1, 0, -3), (0, -1, 0), (0, 0, 1), (3, 0.4, 0)
    o = np.array([[2, 1.2, 1.5], [0.5, 2.5, 1], [1, 1, 1], [1, 1, 1], [1, 0.5, 1]])
    hits = raycast(world, o, [down_table, down_floor, wall, up, into_unknown], max_range=9.0)
    assert hits.label.tolist() == [TABLE, FLOOR, WALL, MISSING, MISSING]
    np.testing.assert_allclose(hits.distance[:3], [0.7, np.sqrt(10) / 3, 1.0], atol=0.01)
    np.testing.assert_allclose(hits.points[0], (2, 1.2, 0.8), atol=0.01)
    assert hits.met.tolist() == [True, True, True, False, False]
    assert np.isinf(hits.distance[3:]).all()
    assert np.isnan(hits.points[3:]).all()
    assert np.isnan(hits.probability[3:]).all()
    assert np.isnan(hits.class_probability[3:]).all()
    answer = world.query(hits.points[:3])
    assert answer.occupancy is not None
    np.testing.assert_array_equal(hits.class_probability[:3], answer.probability)
    np.testing.assert_array_equal(hits.probability[:3], answer.occupancy.probability)
    assert (hits.probability[:3] >= 0.5).all()
    assert hits.label.dtype == np.int32
    assert hits.through_unknown is None


def test_a_ray_that_begins_inside_meets_at_once() -> None:
    assert raycast(room(), (2.0, 1.5, 0.7), [(1, 0, 0)], max_range=1.0).distance[0] == 0


def test_the_range_ends_a_ray_exactly() -> None:
    down = [(0.0, 0.0, -1.0)]
    assert raycast(room(), (0.5, 0.5, 1.0), down, max_range=1.001).met[0]
    assert not raycast(room(), (0.5, 0.5, 1.0), down, max_range=0.99).met[0]


def test_lengths_of_directions_do_not_matter() -> None:
    d = directions(50)
    lengths = np.geomspace(1e-200, 1e200, 50)[:, None]
    short, long = (raycast(room(), EYE, v, max_range=5.0) for v in (d, d * lengths))
    np.testing.assert_allclose(short.distance, long.distance, atol=1e-9)


def test_far_from_the_origin_of_the_world() -> None:
    offset = np.array([5e5, 5e6, 100.0])
    d = directions(300)
    near, far = raycast(room(), EYE, d, max_range=5.0), raycast(room(offset), EYE + offset, d, max_range=5.0)
    np.testing.assert_allclose(far.distance, near.distance, atol=1e-6)


def test_unknown_space_is_measured() -> None:
    world, d = room(), np.vstack([directions(60), (1.0, 0.0, 0.0)])
    hits = raycast(world, EYE, d, max_range=4.0, through_unknown=True)
    ends = np.minimum(hits.distance, 4.0)
    slow = [naive.unknown_length(world, EYE, u, end) for u, end in zip(units(d), ends)]
    assert hits.through_unknown is not None
    np.testing.assert_allclose(hits.through_unknown, slow, atol=1e-9)
    assert hits.through_unknown[-1] == pytest.approx(4.0 - 2.2, abs=world.resolution)
    assert (hits.through_unknown == 0).any()


def test_the_map_is_asked_little() -> None:
    world, n = room(), 5000
    raycast(world, EYE, directions(n), max_range=20.0)
    whole_rays = n * 20.0 / (world.resolution / 2)
    assert sum(world.asked) < whole_rays / 20
    assert max(world.asked) <= BATCH
    assert len(world.asked) < 15


def test_more_rays_than_are_marched_at_once() -> None:
    d = np.tile(directions(100), (400, 1))
    hits = raycast(room(), EYE, d, max_range=3.0)
    assert (hits.distance.reshape(400, 100) == hits.distance[:100]).all()


def test_no_rays() -> None:
    hits = raycast(room(), EYE, np.empty((0, 3)), max_range=3.0, through_unknown=True)
    assert len(hits) == 0
    assert hits.points.shape == (0, 3)
    assert hits.class_probability.shape == (0, 3)
    assert hits.through_unknown is not None
    assert hits.through_unknown.shape == (0,)


def test_no_surface_anywhere() -> None:
    empty = BoxWorld(CLASSES, [(50, 50, 50, 51, 51, 51)], [FLOOR], (0, 0, 0, 1, 1, 1))
    assert not raycast(empty, (0.5, 0.5, 0.5), directions(10), max_range=3.0).met.any()


@pytest.mark.parametrize(
    ("origins", "d", "settings", "complaint"),
    [
        ((0, 0, np.nan), [(1, 0, 0)], {}, "origins has NaN"),
        ((0, 0), [(1, 0, 0)], {}, "origins must have shape"),
        (np.zeros((3, 3)), [(1, 0, 0)] * 2, {}, "to go with 2 directions"),
        (EYE, (1, 0, 0), {}, "directions must have shape"),
        (EYE, [(1, 0, 0), (0, 0, 0)], {}, "row 1 is zero"),
        (EYE, [(1, 0, np.inf)], {}, "directions has NaN"),
        (EYE, [(1, 0, 0)], {"max_range": 0}, "max_range must be"),
        (EYE, [(1, 0, 0)], {"max_range": np.inf}, "max_range must be"),
        (EYE, [(1, 0, 0)], {"max_range": 1e300}, "shorten its range"),
        (EYE, [(1, 0, 0)], {"threshold": 1.0}, "threshold must lie"),
        (EYE, [(1, 0, 0)], {"threshold": np.nan}, "threshold must lie"),
    ],
)
def test_bad_input(origins: ArrayLike, d: ArrayLike, settings: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        raycast(room(), origins, d, **{"max_range": 3.0, **settings})


def test_a_map_without_free_space(corner: LabelledCloud) -> None:
    flat = KNNMap(corner.classes)
    flat.update(corner)
    with pytest.raises(InputError, match=r"free=FreeSpace\(\)"):
        raycast(flat, EYE, [(1, 0, 0)], max_range=3.0)  # type: ignore[arg-type]
