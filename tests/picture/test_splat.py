"""Points in a picture: what hides what, where they land, what discs cover."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgp.camera import NYU_CAMERA, cloud_from_depth
from semgp.classes import Classes
from semgp.errors import InputError
from semgp.picture import (
    DARK,
    GREY,
    WHITE,
    View,
    by_class,
    disc_sizes,
    splat,
    view_of,
)
from tests.picture.samples import AHEAD, BLUE, RED, paint, plain, wall


def test_a_near_point_hides_a_far_one_whatever_their_order() -> None:
    points, colours = np.array([[2.0, 0, 0], [3.0, 0, 0]]), paint(RED, BLUE)
    for order in ([0, 1], [1, 0]):
        assert tuple(plain(points[order], colours[order])[30, 40]) == RED
    sideways = np.array([[2.0, 0.3, 0], [3.0, 0, 0]])
    assert tuple(plain(sideways, colours)[30, 40]) == BLUE


def test_points_land_where_the_pinhole_projects_them() -> None:
    point = np.array([[4.0, -0.5, 0.25]])  # right of the middle by 0.5 m, above it by 0.25 m
    image = plain(point, paint(RED), 0.1)
    row, column = (v.mean() for v in np.nonzero((image != 255).any(axis=2)))
    assert column == pytest.approx(39.5 + AHEAD.focal * 0.5 / 4, abs=0.1)
    assert row == pytest.approx(29.5 - AHEAD.focal * 0.25 / 4, abs=0.1)


@pytest.mark.parametrize("distance", [1.5, 3.0])
def test_a_disc_covers_its_area_in_the_picture(distance: float) -> None:
    view = View.look_at((0, 0, 0), (1, 0, 0), width=320, height=240)
    image = plain(np.array([[distance, 0, 0]]), paint((0, 0, 0)), 0.08, view)
    covered = (255.0 - image[..., 0]).sum() / 255
    assert covered == pytest.approx(np.pi * (view.focal * 0.08 / distance) ** 2, rel=0.02)


def test_overlapping_discs_meet_half_way() -> None:
    image = plain(np.array([[2.0, 0.1, 0], [2.0, -0.1, 0]]), paint(RED, BLUE), 0.25)
    assert [tuple(image[30, column]) for column in (38, 39, 40, 41)] == [RED, RED, BLUE, BLUE]


def test_points_behind_the_camera_and_no_points_leave_the_background() -> None:
    behind = np.array([[-1.0, 0, 0], [0.0, 0, 0], [-5.0, 1, 1]])
    for points in (behind, np.empty((0, 3))):
        colours = np.zeros((len(points), 3), dtype=np.uint8)
        np.testing.assert_array_equal(splat(points, colours, AHEAD), np.full((60, 80, 3), 255))
        assert (splat(points, colours, AHEAD, background=DARK) == DARK).all()


def test_surfaces_are_closed_at_any_distance_and_with_some_points_missing() -> None:
    rng = np.random.default_rng(0)
    for x in (0.3, 1.0, 2.2):
        points = wall(x)[rng.random(10_000) > 0.02]
        image = plain(points, np.tile(paint(RED), (len(points), 1)), None)
        half = int(AHEAD.focal * 0.95 / x)
        middle = image[max(0, 30 - half) : 30 + half, max(0, 40 - half) : 40 + half]
        assert (middle == RED).all()


def test_pinholes_between_small_discs_are_filled() -> None:
    points = wall(0.5)
    image = plain(points, np.tile(paint(RED), (len(points), 1)), 0.6 * 0.02)  # 0.71 would leave no gaps
    assert (image[10:50, 10:70] == RED).all()


def test_a_wide_gap_stays_open() -> None:
    points = wall(1.0)
    points = points[np.abs(points[:, 1]) > 0.1]
    assert (plain(points, np.tile(paint(RED), (len(points), 1)), None)[25:35, 38:42] == WHITE).all()


def test_a_stray_point_does_not_get_a_large_disc() -> None:
    lost = np.column_stack([np.full(12, -40.0), 5.0 * np.arange(12), np.zeros(12)])
    points = np.vstack([wall(2.0), [[1.96, 0.01, 0.01]], lost])
    size = disc_sizes(points)
    usual = 0.6 * 2**0.5 * 0.02
    interior = np.abs(points[:10_000, 1:]).max(axis=1) < 0.9
    np.testing.assert_allclose(size[:10_000][interior], usual)
    np.testing.assert_allclose(size[10_000], usual)
    np.testing.assert_allclose(size[10_001:], 3 * usual)


@pytest.mark.parametrize("n", [0, 1, 2, 5])
def test_disc_sizes_exist_for_few_or_coinciding_points(n: int) -> None:
    for points in (np.zeros((n, 3)), np.random.default_rng(0).random((n, 3))):
        size = disc_sizes(points)
        assert size.shape == (n,)
        assert (size > 0).all()


def test_shading_darkens_behind_an_edge_and_on_slopes_and_can_be_left_out() -> None:
    far, near = wall(3.0), wall(2.0)
    near = near[near[:, 1] > 0]
    points = np.vstack([far, near])
    colours = np.full((len(points), 3), 200, dtype=np.uint8)
    row = splat(points, colours, AHEAD)[30, :, 0].astype(int)
    edge = 40  # the near wall fills the left half
    assert row[edge + 1] < row[edge + 10] - 20
    assert abs(row[edge - 5] - row[edge + 10]) < 5
    assert (splat(points, colours, AHEAD, shading=0)[30, 25:55] == 200).all()

    to_left, to_right = wall(2.0), wall(2.0)  # the lamp is over the left shoulder
    to_left[:, 0] += to_left[:, 1]
    to_right[:, 0] -= to_right[:, 1]
    bright, dark = (
        splat(slope, colours[: len(slope)], AHEAD)[30, 40, 0].astype(int) for slope in (to_left, to_right)
    )
    assert bright > dark + 15


def test_pictures_of_the_same_points_are_the_same() -> None:
    rng = np.random.default_rng(0)
    points, colours = (
        rng.uniform(-1, 1, (5000, 3)) + np.array([3, 0, 0]),
        rng.integers(0, 256, (5000, 3), dtype=np.uint8),
    )
    np.testing.assert_array_equal(splat(points, colours, AHEAD), splat(points, colours, AHEAD))


def test_coordinates_of_a_map_grid_make_the_same_picture() -> None:
    rng = np.random.default_rng(0)
    points, colours = (
        rng.uniform(-1, 1, (500, 3)) + np.array([3, 0, 0]),
        rng.integers(0, 256, (500, 3), dtype=np.uint8),
    )
    away = np.array([5e6, 4e5, 100.0])
    view = View.look_at(away, away + np.array([1, 0, 0]), width=80, height=60)
    difference = splat(points + away, colours, view, 0.05) != splat(points, colours, AHEAD, 0.05)
    assert difference.mean() < 0.01


def test_points_that_cannot_be_drawn_are_refused() -> None:
    points, colours = np.ones((4, 3)), np.zeros((4, 3), dtype=np.uint8)
    for bad in (np.ones((4, 2)), np.full((4, 3), np.nan), np.ones(3)):
        with pytest.raises(InputError, match="points"):
            splat(bad, colours, AHEAD)
        with pytest.raises(InputError, match="points"):
            disc_sizes(bad)
    with pytest.raises(InputError, match="colours"):
        splat(points, colours.astype(float), AHEAD)
    with pytest.raises(InputError, match="colours"):
        splat(points, colours[:3], AHEAD)
    for size in (0.0, -1.0, np.nan, np.ones(3)):
        with pytest.raises(InputError, match="size"):
            splat(points, colours, AHEAD, size)
    with pytest.raises(InputError, match="shading"):
        splat(points, colours, AHEAD, 0.1, shading=-1)


def test_a_nyu_frame_fills_a_picture_in_class_colours(data_dir: Path) -> None:
    depth = np.asarray(Image.open(data_dir / "nyu" / "0282_depth_mm.png")) / 1000
    labels = np.asarray(Image.open(data_dir / "nyu" / "0282_label13.png")).astype(int) - 1
    cloud = cloud_from_depth(depth, NYU_CAMERA, Classes.numbered(13), labels=labels)
    view = view_of(cloud.points, cloud.origin, up=(0, -1, 0), width=320, height=240)
    image = splat(cloud.points, by_class(cloud.hard_labels, cloud.classes), view, shading=0)
    shown = (image[..., None, :] == np.vstack([cloud.classes.palette, [GREY]])).all(axis=3)
    assert shown.any(axis=2).mean() > 0.75  # the rest: background, and blends on borders
    np.testing.assert_array_equal(shown.sum(axis=(0, 1))[:13] > 0, np.isin(np.arange(13), labels))
