"""The pinhole camera and the cloud of an RGB-D frame."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgp.camera import NYU_CAMERA, Pinhole, cloud_from_depth
from semgp.classes import Classes
from semgp.errors import InputError

TWO = Classes(("a", "b"))
CAMERA = Pinhole(500.0, 510.0, 1.5, 0.5)


@given(
    st.floats(100, 2000),
    st.floats(100, 2000),
    st.floats(-50, 50),
    st.floats(-50, 50),
    st.integers(0, 2**32 - 1),
)
def test_back_projection_against_a_loop(fx: float, fy: float, cx: float, cy: float, seed: int) -> None:
    depth = np.random.default_rng(seed).uniform(0.1, 9.0, (3, 4))
    points, valid = Pinhole(fx, fy, cx, cy).back_project(depth)
    assert valid.all()
    for v in range(3):
        for u in range(4):
            d = depth[v, u]
            np.testing.assert_allclose(points[v, u], [(u - cx) * d / fx, (v - cy) * d / fy, d], rtol=1e-12)
            x, y, z = points[v, u]
            np.testing.assert_allclose([fx * x / z + cx, fy * y / z + cy], [u, v], atol=1e-9)


def test_axes_are_right_down_forward() -> None:
    points, _ = NYU_CAMERA.back_project(np.full((480, 640), 2.0))
    assert points[0, 0, 0] < 0 < points[0, 639, 0]
    assert points[0, 0, 1] < 0 < points[479, 0, 1]
    assert (points[..., 2] == 2).all()


def test_depths_that_are_not_valid() -> None:
    depth = np.array([[1.0, 0.0, -1.0, math.nan, math.inf, 5.1, 5.0]])
    points, valid = CAMERA.back_project(depth, max_depth=5.0)
    np.testing.assert_array_equal(valid, [[True, False, False, False, False, False, True]])
    assert np.isnan(points[~valid]).all()
    assert np.isfinite(points[valid]).all()


@pytest.mark.parametrize("bad", [(0, 1, 0, 0), (1, -1, 0, 0), (math.nan, 1, 0, 0), (1, 1, math.inf, 0)])
def test_intrinsics_that_are_refused(bad: tuple[float, float, float, float]) -> None:
    with pytest.raises(InputError):
        Pinhole(*bad)


def test_depth_must_be_an_image() -> None:
    with pytest.raises(InputError, match=r"\(H, W\)"):
        CAMERA.back_project(np.ones(5))


def test_cloud_of_a_frame() -> None:
    depth = np.array([[1.0, 0.0, 2.0], [11.0, 3.0, np.nan]])
    labels = np.array([[0, 1, -1], [1, 1, 0]])
    colours = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
    cloud = cloud_from_depth(depth, CAMERA, TWO, labels, colours=colours)
    np.testing.assert_array_equal(cloud.pixels, [[0, 0], [0, 2], [1, 1]])
    np.testing.assert_array_equal(cloud.labels, [0, -1, 1])
    np.testing.assert_array_equal(cloud.colours, [[0, 1, 2], [6, 7, 8], [12, 13, 14]])
    np.testing.assert_array_equal(cloud.points[:, 2], [1, 2, 3])
    assert cloud.image_shape == (2, 3)
    np.testing.assert_array_equal(cloud.origin, [0, 0, 0])


def test_cloud_in_the_world() -> None:
    T = np.array([[0, 0, 1, 10], [-1, 0, 0, 20], [0, -1, 0, 30], [0, 0, 0, 1.0]])
    depth, weights = np.full((2, 3), 4.0), np.ones((2, 3, 2))
    seen = cloud_from_depth(depth, CAMERA, TWO, weights=weights, T_world_sensor=T)
    local = cloud_from_depth(depth, CAMERA, TWO, weights=weights)
    for world, camera in zip(seen.points, local.points):
        np.testing.assert_allclose(world, (T @ [*camera, 1])[:3], rtol=1e-14)
    np.testing.assert_array_equal(seen.origin, [10, 20, 30])
    assert seen.weights is not None
    assert seen.weights.shape == (6, 2)


def test_frame_without_valid_depth() -> None:
    assert len(cloud_from_depth(np.zeros((2, 2)), CAMERA, TWO, np.zeros((2, 2), int))) == 0


def test_frames_that_are_refused() -> None:
    depth = np.ones((2, 3))
    with pytest.raises(InputError, match="labels must be an image of 2 x 3"):
        cloud_from_depth(depth, CAMERA, TWO, np.zeros((3, 2), int))
    with pytest.raises(InputError, match="T_world_sensor"):
        cloud_from_depth(depth, CAMERA, TWO, T_world_sensor=np.eye(3))
    with pytest.raises(InputError, match="rigid"):
        cloud_from_depth(depth, CAMERA, TWO, T_world_sensor=2 * np.eye(4))
