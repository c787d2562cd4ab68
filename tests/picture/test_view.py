"""Where a picture is taken from."""

import numpy as np
import pytest

from semgp.errors import InputError
from semgp.picture import (
    View,
    view_of,
)
from semgp.scene import DepthCamera, synthetic_room
from tests.picture.samples import in_frame


def test_a_view_looks_at_its_target_with_up_upwards() -> None:
    view = View.look_at((1, 2, 3), (4, 6, 3), up=(0, 0, 5), width=100, height=50)
    np.testing.assert_allclose(view.to_camera(np.array([[4.0, 6, 3]])), [[0, 0, 5]], atol=1e-12)
    np.testing.assert_allclose(view.to_camera(np.array([[1.0, 2, 4]])), [[0, -1, 0]], atol=1e-12)  # y is down
    np.testing.assert_allclose(view.to_camera(np.array([[1.8, 1.4, 3]])), [[1, 0, 0]], atol=1e-12)  # x is right
    assert View(np.eye(4), fov=90, height=50).focal == pytest.approx(25)


def test_views_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InputError, match="along up"):
        View.look_at((0, 0, 0), (0, 0, 2))
    with pytest.raises(InputError, match="vanish"):
        View.look_at((1, 1, 1), (1, 1, 1))
    with pytest.raises(InputError, match="fov"):
        View(np.eye(4), fov=180)
    with pytest.raises(InputError, match="pixel"):
        View(np.eye(4), width=0)
    with pytest.raises(InputError, match="rigid"):
        View(2 * np.eye(4))


def test_an_automatic_view_frames_a_scan_from_behind_and_above_its_sensor() -> None:
    truth = synthetic_room(camera=DepthCamera(160, 120)).scan().truth
    assert truth.T_world_sensor is not None
    view = view_of(truth.points, truth.origin)
    assert in_frame(view, truth.points).mean() > 0.98
    eye, ahead = view.T_world_camera[:3, 3], truth.T_world_sensor[:3, 2]
    assert (eye - truth.T_world_sensor[:3, 3]) @ ahead < 0
    assert eye[2] > truth.T_world_sensor[2, 3]
    assert view.T_world_camera[:3, 2] @ ahead > 0.95


@pytest.mark.parametrize("up", [(0, 0, 1), (0, -1, 0), (1, 1, 0)])
def test_an_automatic_view_of_a_cloud_around_its_sensor_looks_from_above(up: tuple[float, float, float]) -> None:
    points = np.random.default_rng(0).uniform(-10, 10, (4000, 3))
    for origin in (None, (0.0, 0, 0)):
        view = view_of(points, origin, up=up)
        assert in_frame(view, points).mean() > 0.98
        assert (view.T_world_camera[:3, 3] - points.mean(axis=0)) @ np.array(up) > 5
        assert view.T_world_camera[:3, 1] @ np.array(up) < 0


def test_an_automatic_view_needs_points() -> None:
    for bad in (np.empty((0, 3)), np.ones((4, 2)), np.full((2, 3), np.inf)):
        with pytest.raises(InputError, match="points"):
            view_of(bad)
    with pytest.raises(InputError, match="up"):
        view_of(np.ones((4, 3)), up=(0, 0, 0))
    assert in_frame(view_of([[7.0, 8, 9]]), np.array([[7.0, 8, 9]])).all()
