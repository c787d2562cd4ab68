"""Where a camera stands that goes round what it shows."""

import numpy as np
import pytest

from semgp.errors import InputError
from semgp.picture.camera import Camera, below
from semgp.upward import direction
from tests.picture.clouds import box, on_screen


class TestCamera:
    @pytest.mark.parametrize("up", [(0, 0, 1), (0, -1, 0), (1, 0, 0), (0.2, 0.3, 1)])
    @pytest.mark.parametrize("elevation", [-40.0, 0.0, 35.0, 90.0])
    def test_the_view_holds_the_cloud_and_fills_with_it(
        self, up: tuple[float, float, float], elevation: float
    ) -> None:
        points = box()
        view = Camera(elevation=elevation, up=up).view(points, 300, 200)
        place = abs(on_screen(view, points))
        assert (place < 1).all(axis=1).mean() > 0.995
        assert place.max() > 0.9
        upward = np.array(up) / np.linalg.norm(up)
        outward = view.eye - points.mean(axis=0)
        rise = np.degrees(np.arcsin(outward @ upward / np.linalg.norm(outward)))
        assert rise == pytest.approx(elevation, abs=6)

    def test_azimuth_is_the_side_of_the_eye(self) -> None:
        points = box()
        for azimuth, axis in ((0, (1, 0)), (90, (0, 1)), (180, (-1, 0)), (270, (0, -1))):
            view = Camera(azimuth, 10.0).view(points, 300, 200)
            level = (view.eye - points.mean(axis=0))[:2]
            assert level @ axis / np.linalg.norm(level) > 0.99

    def test_from_above_x_is_right_and_y_up(self) -> None:
        view = Camera(elevation=90.0).view(box(), 300, 200)
        middle, right, ahead = on_screen(view, np.array([(10, 20, 5.0), (11, 20, 5), (10, 21, 5)]))
        np.testing.assert_allclose((right - middle)[1], 0, atol=1e-6)
        assert right[0] > middle[0]
        assert ahead[1] < middle[1]

    def test_the_side_is_the_one_that_sees_most(self) -> None:
        """A floor with walls at its two far ends: the eye looks in between them."""
        step = np.arange(0, 4, 0.05)
        floor = np.array([(x, y, 0.0) for x in step for y in step])
        walls = np.array([p for x in step for z in step for p in ((x, 4.0, z), (4.0, x, z))])
        view = Camera().view(np.vstack([floor, walls]), 300, 200)
        assert (view.eye[:2] < 2).all()

    def test_zoom_narrows_the_view(self) -> None:
        points = box()
        near, far = (Camera(0.0, zoom=zoom).view(points, 300, 200) for zoom in (2.0, 1.0))
        np.testing.assert_allclose(near.eye, far.eye)
        np.testing.assert_allclose(on_screen(near, points), 2 * on_screen(far, points))

    def test_an_orbit_goes_round_at_one_distance_and_keeps_the_cloud_in_frame(self) -> None:
        points = box()
        views = list(Camera(30.0).orbit(points, 300, 200, 12))
        assert len(views) == 12
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        out = np.array([view.eye for view in views]) - middle
        np.testing.assert_allclose(np.linalg.norm(out, axis=1), np.linalg.norm(out[0]), rtol=1e-2)
        turned = np.diff(np.unwrap(np.arctan2(out[:, 1], out[:, 0])))
        np.testing.assert_allclose(turned, np.pi / 6, atol=0.02)
        for view in views:
            assert (abs(on_screen(view, points)) < 1).all(axis=1).mean() > 0.99

    def test_far_from_the_origin_the_view_is_the_same(self) -> None:
        points = box()
        a = Camera().view(points, 300, 200)
        b = Camera().view(points + 5e6, 300, 200)
        np.testing.assert_allclose(b.eye - 5e6, a.eye, atol=1e-6)

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"elevation": 91}, "elevation"),
            ({"azimuth": np.nan}, "azimuth"),
            ({"zoom": 0}, "zoom"),
            ({"up": (0, 0, 0)}, "upward"),
            ({"up": (0, 1)}, "upward"),
        ],
    )
    def test_settings_that_are_none(self, settings: dict[str, float], message: str) -> None:
        with pytest.raises(InputError, match=message):
            Camera(**settings)

    def test_clouds_that_are_none(self) -> None:
        for bad in (np.empty((0, 3)), np.ones((3, 2)), np.full((3, 3), np.nan)):
            with pytest.raises(InputError, match="points"):
                Camera().view(bad, 300, 200)
        with pytest.raises(InputError, match="two frames"):
            next(Camera().orbit(box(), 30, 20, 1))

    def test_directions_and_cuts(self) -> None:
        np.testing.assert_array_equal(direction("-y"), [0, -1, 0])
        points = box()
        np.testing.assert_array_equal(below(points, 5.2, direction("z")), points[points[:, 2] <= 5.2])
        np.testing.assert_array_equal(below(points, -20.0, direction("-y")), points[points[:, 1] >= 20])
        assert below(points, None, direction("z")) is not None
        with pytest.raises(InputError, match=r"from 4\.50 to 5\.50"):
            below(points, 1.0, direction("z"))
