"""What planners ask of an OctoMap and of a Gaussian-process map, both of the synthetic room."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.model import BlockModel
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.protocol import SpatialMap
from semgp.octomap import SemanticOctoMap, SensorModel
from semgp.planning import frontiers, information_gain, occupancy_grid, raycast
from semgp.prediction import FREE, UNKNOWN
from semgp.scene import DepthCamera, SyntheticRoom, synthetic_room
from semgp.scene.raycast import cast
from tests.planning import naive

F64 = NDArray[np.float64]
EDGE = 0.1
SURE = SensorModel(hit=0.9, miss=0.2, clamp_min=0.005, clamp_max=0.995)


def scene() -> SyntheticRoom:
    return synthetic_room(views=6, camera=DepthCamera(80, 60))


@cache
def built(kind: str) -> SpatialMap:
    """A map of one view of the room, seen a few times."""
    room = scene()
    if kind == "octomap":
        made: SpatialMap = SemanticOctoMap(room.classes, EDGE, sensor=SURE)
    else:
        made = GPSemanticMap(room.classes, BlockModel(resolution=EDGE), free=FreeSpace())
    for _ in range(5):
        made.update(room.scan(0).truth)
    return made


@pytest.fixture(params=["octomap", "gp"])
def real_map(request: pytest.FixtureRequest) -> SpatialMap:
    return built(request.param)


def rays_of_view(view: int) -> tuple[F64, F64]:
    T = scene().pose(view)
    d = scene().camera.rays.reshape(-1, 3)[::37] @ T[:3, :3].T
    return T[:3, 3], np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


def test_rays_of_a_view_that_was_scanned_end_where_the_room_does(real_map: SpatialMap) -> None:
    o, d = rays_of_view(0)
    hits = raycast(real_map, o, d, max_range=8.0)
    exact = cast(scene().solids, o, d)
    error = hits.distance - exact.distance
    assert hits.met.mean() > 0.98
    assert np.median(np.abs(error)) < 1.2 * EDGE
    assert (np.abs(error) < 3 * EDGE).mean() > 0.85
    truth = scene().scan(0).label.ravel()[::37]
    labelled = hits.label >= 0
    assert (hits.label == truth)[labelled].mean() > 0.85


def test_nothing_is_missed_that_a_march_through_whole_rays_meets(real_map: SpatialMap) -> None:
    o, d = rays_of_view(0)
    hits = raycast(real_map, o, d[::2], max_range=8.0, through_unknown=True)
    slow = np.array([naive.first_surface(real_map, o, u, 8.0, 0.5) for u in d[::2]])
    assert np.isclose(hits.distance, slow, rtol=0, atol=EDGE / 2).mean() > 0.95
    assert hits.through_unknown is not None
    assert (hits.through_unknown <= np.minimum(hits.distance, 8.0)).all()


def test_a_view_gains_less_once_it_was_taken(real_map: SpatialMap) -> None:
    room = scene()
    poses = np.stack([room.pose(view) for view in range(6)])
    rays = room.camera.rays.reshape(-1, 3)[::37]
    gain = information_gain(real_map, poses, rays, max_range=5.0)
    assert gain.total[3] > 1.5 * gain.total[0]
    slow = naive.gain(real_map, poses[3], rays[:20], 2.0, EDGE, (0.05, 0.2), 1e-3)
    fast = information_gain(real_map, poses[3:4], rays[:20], max_range=2.0)
    np.testing.assert_allclose([fast.occupancy[0], fast.classes[0]], slow, rtol=1e-4)


def test_frontiers_are_free_and_touch_the_unknown(real_map: SpatialMap) -> None:
    found = frontiers(real_map, (-2.5, -2, 0.1), (2.5, 2, 2.4))
    assert len(found.points) > 20
    assert found.sizes.sum() == len(found.points)
    occupancy = real_map.query(found.points).occupancy
    assert occupancy is not None
    assert (occupancy.state == FREE).all()
    beside = np.concatenate([np.eye(3), -np.eye(3)]) * EDGE
    around = real_map.query((found.points[:, None] + beside).reshape(-1, 3)).occupancy
    assert around is not None
    assert (around.state == UNKNOWN).reshape(-1, 6).any(axis=1).all()


def test_the_floor_is_free_to_drive_and_the_table_is_not(real_map: SpatialMap) -> None:
    room, costs = scene(), {"floor": 0}
    grid = occupancy_grid(real_map, (-2.6, -2.1), (2.6, 2.1), heights=(-0.1, 1.1), resolution=EDGE, costs=costs)
    assert grid.costs is not None
    rows, columns = grid.data.shape
    x, y = np.meshgrid(-2.6 + (np.arange(columns) + 0.5) * EDGE, -2.1 + (np.arange(rows) + 0.5) * EDGE)
    above = np.stack([x, y, np.full_like(x, 1.1)], axis=-1).reshape(-1, 3)
    below = cast(room.solids, above, np.tile((0.0, 0.0, -1.0), (len(above), 1)))
    stands = (below.distance < 1.0).reshape(grid.data.shape)
    known = grid.costs >= 0
    assert known.mean() > 0.5
    assert (grid.costs[known & stands] == 100).mean() > 0.6
    lethal_floor = (grid.costs[known & ~stands] == 100).mean()
    assert lethal_floor < 0.4
