"""Frontiers against a flood fill."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from semgp.baselines.knn import KNNMap
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.planning import frontiers
from tests.planning import naive
from tests.planning.box_world import CLASSES, FLOOR, BoxWorld, room

LOW, HIGH = np.array([1.0, -0.25, -0.1]), np.array([3.9, 3.2, 1.4])


@pytest.mark.parametrize("edge", [0.17, 0.14])
def test_clusters_are_those_of_the_flood_fill(edge: float) -> None:
    world = room()
    world.boxes[-1] = 2.0, -0.2, 0.0, 4.0, 3.2, 1.2  # the leg becomes a bar that parts what is below from above
    world.boxes[-2] = 3.1, 1.0, 0.0, 3.5, 1.3, 2.0
    found = frontiers(world, LOW, HIGH, resolution=edge)
    shape = tuple(int(n) for n in np.ceil((HIGH - LOW) / edge))
    slow = naive.frontier_clusters(world, LOW, (shape[0], shape[1], shape[2]), edge)
    assert found.sizes.tolist() == [len(cluster) for cluster in slow]
    cells = np.rint((found.points - LOW) / edge - 0.5).astype(int)
    fast = [{(x, y, z) for x, y, z in cells[found.cluster == k].tolist()} for k in range(len(found.sizes))]
    assert len(slow) >= 2
    assert {frozenset(cluster) for cluster in fast} == {frozenset(cluster) for cluster in slow}
    assert (np.diff(found.cluster) >= 0).all()
    for k, centre in enumerate(found.centres):
        np.testing.assert_allclose(centre, found.points[found.cluster == k].mean(axis=0))


def test_the_frontier_of_the_room_is_where_it_was_seen_last() -> None:
    found = frontiers(room(), (0, 0, 0), (4, 3, 2))
    np.testing.assert_allclose(found.points[:, 0], 3.15)
    assert found.sizes.tolist() == [30 * 20]
    np.testing.assert_allclose(found.centres, [(3.15, 1.5, 1.0)])


def test_a_frontier_in_pieces_far_from_the_origin() -> None:
    offset = np.array([5e5, 5e6, 100.0])
    world = BoxWorld(
        CLASSES, np.array([(0.4, 0, 0, 1, 1, 1)]) + np.tile(offset, 2), [FLOOR],
        np.array([0, 0, 0, 1, 1, 0.8]) + np.tile(offset, 2),
    )  # fmt: skip
    found = frontiers(world, offset, offset + 1)
    assert found.sizes.tolist() == [4 * 10]
    np.testing.assert_allclose(found.points[:, 2] - offset[2], 0.75, atol=1e-6)


def test_none() -> None:
    for low, high in (((0.5, 0.5, 0.5), (1, 1, 1)), ((3.5, 1, 1), (3.9, 2, 2))):
        found = frontiers(room(), low, high)
        assert found.points.shape == (0, 3)
        assert found.centres.shape == (0, 3)
        assert len(found.cluster) == len(found.sizes) == 0


@pytest.mark.parametrize(
    ("low", "high", "settings", "complaint"),
    [
        ((0, 0, 1), (1, 1, 0), {}, "low below high"),
        ((0, 0), (1, 1), {}, "3 finite numbers"),
        ((0, 0, np.nan), (1, 1, 1), {}, "3 finite numbers"),
        ((0, 0, 0), (1, 1, np.inf), {}, "3 finite numbers"),
        ("low", (1, 1, 1), {}, "low must be an array of numbers"),
        ((0, 0, 0), (100, 100, 100), {}, "more than 16,777,216"),
        ((0, 0, 0), (1e200, 1e200, 1e200), {}, "more than 16,777,216"),
        ((0, 0, 0), (1, 1, 1), {"resolution": 0}, "resolution must be"),
    ],
)
def test_bad_input(low: ArrayLike, high: ArrayLike, settings: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        frontiers(room(), low, high, **settings)


def test_a_map_without_free_space(corner: LabelledCloud) -> None:
    flat = KNNMap(corner.classes)
    flat.update(corner)
    with pytest.raises(InputError, match=r"free=FreeSpace\(\)"):
        frontiers(flat, (0, 0, 0), (1, 1, 1))  # type: ignore[arg-type]
