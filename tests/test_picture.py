"""Pictures: what hides what, where points land, colours, and how pages are put together."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from semgp.camera import NYU_CAMERA, cloud_from_depth
from semgp.classes import MISSING, Classes
from semgp.errors import InputError
from semgp.picture import (
    COLOUR_MAPS,
    DARK,
    GREY,
    WHITE,
    View,
    by_class,
    by_value,
    colour_bar,
    disc_sizes,
    legend,
    panels,
    save_png,
    splat,
    stack,
    view_of,
)
from semgp.picture.compose import _ticks
from semgp.scene import DepthCamera, synthetic_room

RED, BLUE = (200, 30, 40), (30, 60, 210)
AHEAD = View.look_at((0, 0, 0), (1, 0, 0), width=80, height=60)  # along x, z up


def paint(*colours: tuple[int, int, int]) -> NDArray[np.uint8]:
    return np.array(colours, dtype=np.uint8)


def plain(
    points: object, colours: NDArray[np.uint8], size: object = 0.05, view: View = AHEAD
) -> NDArray[np.uint8]:
    return splat(points, colours, view, size, shading=0)  # type: ignore[arg-type]


def wall(x: float, spacing: float = 0.02, half: float = 1.0) -> NDArray[np.float64]:
    """Return a square grid of points across the direction of view."""
    y, z = np.meshgrid(*[np.arange(-half, half, spacing)] * 2)
    return np.column_stack([np.full(y.size, x), y.ravel(), z.ravel()])


def contains(page: NDArray[np.uint8], colour: tuple[int, int, int]) -> bool:
    """Return whether a picture has a patch of a colour, not just a pixel of blended letters."""
    return int((page == colour).all(axis=2).sum()) > 50


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


def in_frame(view: View, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    x, y, z = view.to_camera(points).T
    return np.asarray(
        (z > 0) & (np.abs(x / z) * view.focal < view.width / 2) & (np.abs(y / z) * view.focal < view.height / 2)
    )


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


def test_class_colours_and_missing_grey() -> None:
    classes = Classes(("a", "b"), (RED, BLUE))
    labels = np.array([[0, 1], [MISSING, 0]])
    np.testing.assert_array_equal(by_class(labels, classes), [[RED, BLUE], [GREY, RED]])
    assert by_class(np.array([], dtype=int), classes).shape == (0, 3)
    for bad in ([2], [-2], [0.5]):
        with pytest.raises(InputError, match="labels"):
            by_class(bad, classes)


@pytest.mark.parametrize("name", COLOUR_MAPS)
def test_colour_maps_follow_their_originals_from_end_to_end(name: str) -> None:
    values = np.linspace(3, 5, 256)
    ours, original = by_value(values, colour_map=name), 255 * mpl.colormaps[name](np.linspace(0, 1, 256))
    np.testing.assert_array_equal(ours[[0, -1]], np.round(original[[0, -1], :3]))
    assert np.abs(ours.astype(int) - original[:, :3]).max() <= 7
    lightness = ours @ np.array([0.299, 0.587, 0.114])
    assert (np.diff(lightness) > -0.5).all()


def test_values_beyond_the_ends_share_the_end_colours_and_nan_is_grey() -> None:
    colours = by_value([-np.inf, -1.0, 0.0, 1.0, 9.0, np.nan], low=0, high=1)
    np.testing.assert_array_equal(colours[[0, 5]], [GREY, GREY])
    np.testing.assert_array_equal(colours[1], colours[2])
    np.testing.assert_array_equal(colours[3], colours[4])
    assert by_value([]).shape == (0, 3)
    assert (by_value([np.nan, np.nan]) == GREY).all()
    assert (by_value([2.0, 2.0]) == by_value([0.0, 1.0])[0]).all()
    with pytest.raises(InputError, match="jet"):
        by_value([1.0], colour_map="jet")
    with pytest.raises(InputError, match="low end"):
        by_value([1.0], low=2, high=1)


def test_a_grid_holds_its_pictures_unchanged() -> None:
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 256, (30, 40, 3), dtype=np.uint8) for _ in range(5)]
    page = panels(images, columns=3, font_size=10)
    assert page.shape == (2 * 30 + 3 * 10, 3 * 40 + 4 * 10, 3)
    np.testing.assert_array_equal(page[10:40, 10:50], images[0])
    np.testing.assert_array_equal(page[50:80, 60:100], images[4])
    assert (page[50:80, 110:150] == 255).all()  # the empty cell
    assert panels(images).shape[1] > panels(images, columns=1).shape[1]


def test_titles_are_written_above_the_pictures_in_readable_ink() -> None:
    image = np.full((30, 120, 3), 128, dtype=np.uint8)
    for background, darkest in ((WHITE, True), (DARK, False)):
        page = panels([image, image], ["truth", ""], background=background)
        head = page[: len(page) - 30 - 24].astype(int)
        left, right = head[:, : head.shape[1] // 2], head[:, head.shape[1] // 2 :]
        assert (left.min() < 60) if darkest else (left.max() > 200)
        assert (right == background).all()
    with pytest.raises(InputError, match="titles"):
        panels([image, image], ["one"])
    with pytest.raises(InputError, match="at least one picture"):
        panels([])
    with pytest.raises(InputError, match="column"):
        panels([image], columns=0)
    with pytest.raises(InputError, match="uint8"):
        panels([image.astype(float)])


def test_a_stack_centres_its_pictures() -> None:
    wide, narrow = np.zeros((10, 50, 3), dtype=np.uint8), np.full((20, 30, 3), 9, dtype=np.uint8)
    page = stack([wide, narrow])
    assert page.shape == (30, 50, 3)
    assert (page[10:, 10:40] == 9).all()
    assert (page[10:, :10] == 255).all()
    with pytest.raises(InputError, match="at least one"):
        stack([])


def test_a_legend_shows_every_class_and_fits_its_width() -> None:
    classes = Classes.numbered(9)
    tall, wide = legend(classes), legend(classes, width=700)
    assert wide.shape[1] == 700
    assert len(tall) > 2.5 * len(wide)
    assert tall.shape[1] < 700
    for page in (tall, wide):
        assert all(contains(page, colour) for colour in classes.colours)
        assert not contains(page, GREY)
    with_missing = legend(classes, missing="no label")
    assert contains(with_missing, GREY)
    assert len(with_missing) > len(tall)
    assert legend(classes, width=10).shape[1] == tall.shape[1]  # never narrower than one column
    assert len(legend(classes, font_size=12)) < len(tall)


def test_a_colour_bar_runs_from_end_to_end() -> None:
    page = colour_bar(0, 2, "entropy (nats)", width=300, font_size=20)
    assert page.shape[1] == 300
    ends = by_value([0.0, 2.0])
    bar = page[46]  # through the middle of the bar
    np.testing.assert_array_equal(bar[[40, 259]], ends)
    assert (bar[:40] == 255).all()
    assert (bar[260:] == 255).all()
    assert len(colour_bar(0, 2, width=300, font_size=20)) < len(page)
    for low, high in ((1, 1), (2, 1), (0, np.inf)):
        with pytest.raises(InputError, match="ends"):
            colour_bar(low, high)
    with pytest.raises(InputError, match="width"):
        colour_bar(0, 1, width=50)


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.integers(2, 12))
def test_ticks_are_few_round_numbers_between_the_ends(low: float, span: float, most: int) -> None:
    high = low + span
    ticks = _ticks(low, high, most)
    slack = 1e-6 * max(abs(low), abs(high), span)
    assert len(ticks) <= most + 1
    assert all(low - slack <= t <= high + slack for t in ticks)
    if len(ticks) > 1:
        np.testing.assert_allclose(np.diff(ticks), ticks[1] - ticks[0], rtol=1e-5, atol=slack)


def test_known_ticks() -> None:
    assert _ticks(0, 1, 5) == [0, 0.2, 0.4, 0.6, 0.8, 1]
    assert _ticks(0.03, 1.49, 3) == [0.5, 1.0]
    assert _ticks(-20, 100, 4) == [0, 50, 100]


def test_a_saved_picture_reads_back_the_same(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    save_png(tmp_path / "a.png", image)
    save_png(str(tmp_path / "a.png"), image[::-1])  # replaces
    with Image.open(tmp_path / "a.png") as saved:
        assert saved.format == "PNG"
        np.testing.assert_array_equal(np.asarray(saved), image[::-1])
    assert [f.name for f in tmp_path.iterdir()] == ["a.png"]


def test_what_is_no_picture_is_not_saved(tmp_path: Path) -> None:
    image = np.zeros((20, 30, 3), dtype=np.uint8)
    for bad in (image.astype(float), image[..., 0], image[:0]):
        with pytest.raises(InputError, match="picture"):
            save_png(tmp_path / "a.png", bad)
    with pytest.raises(InputError, match="png"):
        save_png(tmp_path / "a.jpg", image)
    with pytest.raises(InputError, match="folder"):
        save_png(tmp_path / "none" / "a.png", image)
    assert not list(tmp_path.iterdir())


def test_a_nyu_frame_fills_a_picture_in_class_colours(data_dir: Path) -> None:
    depth = np.asarray(Image.open(data_dir / "nyu" / "0282_depth_mm.png")) / 1000
    labels = np.asarray(Image.open(data_dir / "nyu" / "0282_label13.png")).astype(int) - 1
    cloud = cloud_from_depth(depth, NYU_CAMERA, Classes.numbered(13), labels=labels)
    view = view_of(cloud.points, cloud.origin, up=(0, -1, 0), width=320, height=240)
    image = splat(cloud.points, by_class(cloud.hard_labels, cloud.classes), view, shading=0)
    shown = (image[..., None, :] == np.vstack([cloud.classes.palette, [GREY]])).all(axis=3)
    assert shown.any(axis=2).mean() > 0.75  # the rest: background, and blends on borders
    np.testing.assert_array_equal(shown.sum(axis=(0, 1))[:13] > 0, np.isin(np.arange(13), labels))
