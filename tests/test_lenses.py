"""Lenses, against scalar formulas; and cameras that have one."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.camera import Pinhole, cloud_from_depth
from semgp.classes import Classes
from semgp.distortion import DistortedCamera
from semgp.errors import InputError
from semgp.lenses import BrownConrady, Equidistant, Lens, Plane, lens_of

PINHOLE = Pinhole(220.0, 230.0, 159.0, 122.0)
U, V = np.meshgrid(np.arange(0, 320.0, 8), np.arange(0, 240.0, 8))
X, Y = (U - PINHOLE.cx) / PINHOLE.fx, (V - PINHOLE.cy) / PINHOLE.fy

small = st.floats(-0.02, 0.02)
brown = st.builds(BrownConrady, st.floats(-0.4, 0.4), st.floats(-0.2, 0.2), small, small, st.floats(-0.05, 0.05))
rational = st.builds(
    BrownConrady,
    st.floats(-1, 1),
    st.floats(-1, 1),
    small,
    small,
    st.floats(-0.2, 0.2),
    st.floats(-1, 1),
    st.floats(-1, 1),
    st.floats(-0.2, 0.2),
)
fisheye = st.builds(
    Equidistant, st.floats(-0.1, 0.1), st.floats(-0.05, 0.05), st.floats(-0.02, 0.02), st.floats(-0.01, 0.01)
)


def naive(lens: Lens, x: float, y: float) -> tuple[float, float]:
    """Return where the light of a direction falls, by OpenCV's formulas as they are printed."""
    if isinstance(lens, BrownConrady):
        r = math.hypot(x, y)
        R = (1 + lens.k1 * r**2 + lens.k2 * r**4 + lens.k3 * r**6) / (
            1 + lens.k4 * r**2 + lens.k5 * r**4 + lens.k6 * r**6
        )
        return (
            x * R + 2 * lens.p1 * x * y + lens.p2 * (r**2 + 2 * x**2),
            y * R + lens.p1 * (r**2 + 2 * y**2) + 2 * lens.p2 * x * y,
        )
    assert isinstance(lens, Equidistant)
    a, r = math.atan(math.hypot(x, y)), math.hypot(x, y)
    bent = a * (1 + lens.k1 * a**2 + lens.k2 * a**4 + lens.k3 * a**6 + lens.k4 * a**8)
    return (bent * x / r, bent * y / r) if r else (0.0, 0.0)


def naive_fold(lens: Lens) -> float:
    """Return the angle from the axis up to which the distorted radius grows, in steps of a thousandth."""
    last = 0.0
    for k in range(1, 1550):
        x = math.tan(k / 1000)
        plain = lens if isinstance(lens, Equidistant) else BrownConrady(**{**vars(lens), "p1": 0.0, "p2": 0.0})
        now = naive(plain, x, 0.0)[0]
        if not now > last:
            return (k - 1) / 1000
        last = now
    return 1.55


@given(st.one_of(brown, rational, fisheye))
def test_pixels_that_are_undistorted_come_back(lens: Lens) -> None:
    x, y = lens.undistort(X, Y)
    found = np.isfinite(x)
    np.testing.assert_array_equal(found, np.isfinite(y))
    assert found[np.hypot(X, Y) < 0.05].all()
    for i, j in np.argwhere(found)[::7]:
        u, v = naive(lens, x[i, j], y[i, j])
        assert abs(u - X[i, j]) * PINHOLE.fx < 1e-6
        assert abs(v - Y[i, j]) * PINHOLE.fy < 1e-6


@given(st.one_of(brown, rational, fisheye), st.floats(0, 2 * math.pi), st.floats(0, 0.8))
def test_directions_are_found_again(lens: Lens, around: float, share: float) -> None:
    fold = naive_fold(lens)
    r = math.tan(share * min(fold, 0.9))
    x, y = r * math.cos(around), r * math.sin(around)
    bent = naive(lens, x, y)
    there = lens.distort(np.array([x]), np.array([y]))
    np.testing.assert_allclose(np.ravel(there), bent, atol=1e-12)
    back = np.ravel(lens.undistort(np.array([bent[0]]), np.array([bent[1]])))
    jacobian = np.array([naive(lens, x + 1e-6, y), naive(lens, x, y + 1e-6)]) - bent
    if np.linalg.svd(jacobian / 1e-6)[1].min() > 0.3:  # elsewhere the tangential terms fold the image themselves
        np.testing.assert_allclose(back, [x, y], atol=1e-6)


def test_pixels_beyond_the_fold_are_left_out() -> None:
    lens = BrownConrady(-0.5, 0.0, 0.0, 0.0)  # r - r³ / 2 grows up to r = 0.816, to 0.544
    x, _ = lens.undistort(np.array([0.5, 0.54, 0.55, 5.0]), np.zeros(4))
    np.testing.assert_array_equal(np.isfinite(x), [True, True, False, False])
    assert x[1] < math.sqrt(2 / 3)
    camera = DistortedCamera(Pinhole(100.0, 100.0, 0.0, 0.0), lens)
    points, valid = camera.back_project(np.full((1, 60), 2.0))
    np.testing.assert_array_equal(valid[0], np.arange(60) < 55)
    assert np.isnan(points[~valid]).all()
    assert len(cloud_from_depth(np.full((1, 60), 2.0), camera, Classes(("a",)), np.zeros((1, 60), int))) == 55


@pytest.mark.parametrize("lens", [BrownConrady(0, 0, 0, 0), Equidistant(1 / 3, 2 / 15, 17 / 315, 62 / 2835)])
def test_a_lens_that_does_nothing(lens: Lens) -> None:
    """The second one is the series of the tangent: near the axis it is a pinhole."""
    depth = np.random.default_rng(0).uniform(0.5, 4, (30, 40))
    plain = Pinhole(400.0, 410.0, 20.0, 14.0)
    expected, _ = plain.back_project(depth)
    found, valid = DistortedCamera(plain, lens).back_project(depth)
    assert valid.all()
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_points_of_a_distorted_camera() -> None:
    lens = BrownConrady(-0.3, 0.1, 0.001, -0.002, 0.01)
    depth = np.random.default_rng(1).uniform(0.5, 4, (24, 32))
    depth[3, 4], depth[5, 6] = np.nan, 20.0
    camera = Pinhole(30.0, 31.0, 15.2, 12.1)
    points, valid = DistortedCamera(camera, lens).back_project(depth, max_depth=10.0)
    assert valid.sum() == depth.size - 2
    for v, u in np.argwhere(valid):
        x, y, z = points[v, u]
        bent = naive(lens, x / z, y / z)
        assert z == depth[v, u]
        np.testing.assert_allclose([bent[0] * 30.0 + 15.2, bent[1] * 31.0 + 12.1], [u, v], atol=1e-6)
    with pytest.raises(InputError, match=r"\(H, W\)"):
        DistortedCamera(camera, lens).back_project(np.ones(5))


def test_rays_are_computed_once_a_camera() -> None:
    calls = []

    class Counted(BrownConrady):
        def undistort(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Plane:
            calls.append(x.size)
            return super().undistort(x, y)

    for depth in (1.0, 2.0):
        camera = DistortedCamera(PINHOLE, Counted(0.01, 0.02, 0.0, 0.0))  # as each frame's camera info makes one
        points, _ = camera.back_project(np.full((24, 32), depth))
        assert (points[..., 2] == depth).all()
    assert sum(calls) == 24 * 32


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=8, max_size=8))
def test_absurd_coefficients_see_nothing_wrong(coefficients: list[float]) -> None:
    lenses: list[Lens] = [BrownConrady(*coefficients), Equidistant(*coefficients[:4])]
    for lens in lenses:
        x, y = lens.undistort(X[::9, ::9], Y[::9, ::9])
        for i, j in np.argwhere(np.isfinite(x)):
            with np.errstate(all="ignore"):
                u, v = lens.distort(x[i : i + 1, j], y[i : i + 1, j])
            np.testing.assert_allclose([u[0], v[0]], [X[::9, ::9][i, j], Y[::9, ::9][i, j]], atol=1e-7)


def test_lenses_by_name() -> None:
    five = [0.1, 0.2, 0.3, 0.4, 0.5]
    assert lens_of("plumb_bob", five) == BrownConrady(*five)
    assert lens_of("plumb_bob", five[:4]) == BrownConrady(*five[:4])
    eight = [*five, 1.0, 2.0, 3.0]
    assert lens_of("rational_polynomial", eight) == BrownConrady(*eight)
    assert lens_of("equidistant", five[:4]) == Equidistant(*five[:4])
    with pytest.raises(InputError, match=r"model 'omni', not one of plumb_bob.*rectify the images"):
        lens_of("omni", five)
    with pytest.raises(InputError, match="has 8 finite coefficients"):
        lens_of("rational_polynomial", five)
    with pytest.raises(InputError, match="finite"):
        lens_of("equidistant", [0.1, math.nan, 0, 0])
