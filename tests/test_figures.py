"""Figures: cubes against ray casting, rows of maps, the Stanford room, reliability and costs."""

import io
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import maximum_filter, minimum_filter

from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.conventions import NYU13
from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.evaluation.calibration import reliability
from semgp.evaluation.cubes import draw_cubes
from semgp.evaluation.curves import cost_figure, pooled, reliability_figure
from semgp.evaluation.figures import Figure, camera_view, map_row, maps_figure, only, picture_figure, street_view
from semgp.evaluation.room import STANFORD, STANFORD_IDS, into_room, octomap_figure, stanford_room
from semgp.evaluation.task import Result
from semgp.picture import GREY, View, by_class
from tests.reader_samples import write_pcd
from tests.results import patches_task, results_of

PURE = np.array([(250, 0, 0), (0, 250, 0), (0, 0, 250)], dtype=np.uint8)


def opened(figure: Figure) -> NDArray[np.uint8]:
    image = Image.open(io.BytesIO(figure.png))
    assert image.format == "PNG"
    return np.asarray(image)


def nearest_cubes(
    centres: NDArray[np.float64], edge: float, view: View, columns: NDArray[np.float64], rows: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return which cube the ray through each place of the picture meets first, -1 for none."""
    x, y = (columns - (view.width - 1) / 2) / view.focal, (rows - (view.height - 1) / 2) / view.focal
    T = view.T_world_camera
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ T[:3, :3].T
    offset = (centres - T[:3, 3])[:, None, None]
    slabs = np.stack([(offset + side * edge / 2) / rays for side in (-1, 1)])
    enter, leave = slabs.min(axis=0).max(axis=-1), slabs.max(axis=0).min(axis=-1)
    enter = np.where((enter < leave) & (enter > 0), enter, np.inf)
    return np.where(np.isfinite(enter).any(axis=0), enter.argmin(axis=0), -1)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_cubes_are_those_that_rays_meet(seed: int) -> None:
    rng = np.random.default_rng(seed)
    edge = float(rng.uniform(0.05, 0.5))
    cells = np.argwhere(rng.random((4, 4, 4)) < rng.uniform(0.1, 0.6))
    centres = np.asarray(edge * (np.append(cells, [(0, 0, 0)], axis=0) + rng.integers(-9, 9, 3) + 0.5))
    centres = np.unique(centres, axis=0)
    direction = rng.normal(size=3)
    eye = centres.mean(axis=0) + 9 * edge * direction / np.linalg.norm(direction)
    view = View.look_at(eye, centres.mean(axis=0), fov=40, width=48, height=36)
    kind = rng.integers(0, 3, len(centres))

    drawn = draw_cubes(centres, edge, PURE[kind], view)
    seen = np.where((drawn == 255).all(axis=2), -1, drawn.argmax(axis=2))
    finely = np.meshgrid(np.arange(4 * 48) / 4, np.arange(4 * 36) / 4)
    met = nearest_cubes(centres, edge, view, *finely)
    met = np.where(met < 0, -1, kind[met])
    # away from borders, which pixels share
    inside = (maximum_filter(met, 13) == minimum_filter(met, 13))[::4, ::4]
    # one cube may show through a gap narrower than the quarter of a pixel that is looked at
    assert np.count_nonzero(seen[inside] != met[::4, ::4][inside]) <= 2
    assert inside.sum() > 300


def test_sides_differ_in_light_and_hidden_ones_are_not_drawn() -> None:
    view = View.look_at((3, -4, 3), (0, 0, 0), fov=30, width=48, height=36)
    one = draw_cubes([(0.0, 0, 0)], 1.0, PURE[:1], view)
    shades = {int(v) for v in np.unique(one[..., 0]) if (one[..., 0] == v).sum() > 20 and v < 255}
    assert len(shades) == 3
    assert np.array_equal(draw_cubes([(0.0, 0, 0)], 1.0, PURE[:1], view), one)


def test_cubes_behind_or_around_the_eye_are_left_out() -> None:
    view = View.look_at((0, 0, 0), (1, 0, 0), width=48, height=36)
    assert (draw_cubes([(-3.0, 0, 0), (0, 0, 0)], 1.0, PURE[:2], view) == 255).all()
    assert (draw_cubes(np.zeros((0, 3)), 1.0, PURE[:0], view, (1, 2, 3)) == (1, 2, 3)).all()


@pytest.mark.parametrize(
    ("centres", "edge", "colours", "message"),
    [
        (np.full((2, 3), np.nan), 1.0, PURE[:2], "finite"),
        (np.zeros((2, 2)), 1.0, PURE[:2], "shape"),
        (np.zeros((2, 3)), 0.0, PURE[:2], "positive"),
        (np.zeros((2, 3)), float("nan"), PURE[:2], "positive"),
        (np.zeros((2, 3)), 1.0, PURE, "colours"),
        (np.zeros((2, 3)), 1.0, PURE[:2] / 255, "colours"),
    ],
)
def test_what_cubes_refuse(
    centres: NDArray[np.float64], edge: float, colours: NDArray[np.uint8], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        draw_cubes(centres, edge, colours, View(np.eye(4), width=48, height=36))


@pytest.fixture(scope="module")
def results() -> list[Result]:
    return results_of(patches_task("282"))


def test_a_row_shows_colours_truth_methods_and_entropy(results: list[Result]) -> None:
    task = patches_task("282")
    view = camera_view(task.truth, width=80)
    row = map_row(task, results, view)
    auc = results[0].scores.auc_total
    assert len(row.pictures) == len(row.titles) == 5
    assert row.titles[0] == "282, sparse: colour image"
    assert row.titles[2].startswith(f"Semantic OctoMap: AUC {auc:.3f}")
    assert row.titles[4] == "k-NN: entropy"
    assert {picture.shape for picture in row.pictures} == {(60, 80, 3)}
    assert list(row.labels) == [MISSING, 0, 1, 2, 3]
    truth, octomap, knn = (set(map(tuple, p.reshape(-1, 3).tolist())) for p in row.pictures[1:4])
    # discs that face the camera before a flat wall keep their colours somewhere
    for label in range(4):
        hue = np.array(NYU13.colours[label]) / 255
        for colours in (truth, knn):
            assert min(np.abs(np.array(list(colours)) / 255 - hue).max(axis=1)) < 0.2
    grey = np.array(list(octomap))
    assert (np.ptp(grey, axis=1)[(grey < 230).all(axis=1)] < 4).any()


def test_a_row_without_colours_begins_with_the_truth(results: list[Result]) -> None:
    task = patches_task("282")
    bare = replace(task, truth=replace(task.truth, colours=None))
    row = map_row(bare, results[:1], camera_view(task.truth, width=80))
    assert row.titles[0] == "282, sparse: truth"
    assert len(row.pictures) == 3


def test_entropy_is_grey_where_nothing_was_observed(results: list[Result]) -> None:
    task = patches_task("282")
    octomap = results[0]
    assert octomap.prediction is not None
    nothing = replace(octomap.prediction, observed=np.zeros(len(octomap.prediction), dtype=bool))
    row = map_row(task, [replace(octomap, prediction=nothing)], camera_view(task.truth, width=80))
    entropy = row.pictures[-1].reshape(-1, 3).astype(int)
    assert np.ptp(entropy, axis=1).max() <= 1  # nothing but grey and white
    assert entropy.min() < max(GREY) + 20


def test_rows_make_a_figure(results: list[Result]) -> None:
    task = patches_task("282")
    row = map_row(task, results, camera_view(task.truth, width=320))
    one, two = maps_figure([row]), maps_figure([row, row])
    assert one.name == "maps"
    width = 5 * 320
    assert opened(one).shape[1] >= width
    assert opened(two).shape[0] - opened(one).shape[0] > 240
    with pytest.raises(InputError, match="needs rows"):
        maps_figure([])
    with pytest.raises(InputError, match="same number"):
        maps_figure([row, map_row(task, results[:1], camera_view(task.truth, width=320))])


def test_what_a_row_refuses(results: list[Result]) -> None:
    task = patches_task("282")
    view = camera_view(task.truth, width=80)
    for unfit in ([], [replace(results[0], prediction=None)], results_of(patches_task("282", seed=1))):
        with pytest.raises(InputError, match="needs results"):
            map_row(task, unfit, view)


def test_street_view_looks_along_the_lidars_x(results: list[Result]) -> None:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = [(0, -1, 0), (0, 0, -1), (1, 0, 0)], (5, 6, 7)
    cloud = LabelledCloud(np.zeros((1, 3)), NYU13, T_world_sensor=T)
    view = street_view(cloud, width=300)
    ahead, above = T[:3, :3] @ (1, 0, 0), T[:3, :3] @ (0, 0, 1)
    assert view.T_world_camera[:3, 2] @ ahead > 0.7
    assert view.T_world_camera[:3, 1] @ above < -0.7
    assert (view.T_world_camera[:3, 3] - T[:3, 3]) @ above > 5
    with pytest.raises(InputError, match="pose"):
        street_view(replace(cloud, T_world_sensor=None))


def test_only_the_classes_that_occur() -> None:
    some = only(NYU13, np.array([MISSING, 4, 1, 4]))
    assert some.names == ("books", "floor")
    assert some.colours == (NYU13.colours[1], NYU13.colours[4])


def test_picture_figure_is_the_picture() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    assert np.array_equal(opened(picture_figure("a", "b", picture)), picture)


def room_cloud(n: int = 300) -> LabelledCloud:
    rng = np.random.default_rng(2)
    return LabelledCloud(rng.uniform(0, 2, (n, 3)), STANFORD, labels=rng.integers(0, len(STANFORD), n, np.int32))


def write_pieces(folder: Path, ids: tuple[int, ...]) -> None:
    cloud = room_cloud()
    labels = np.array(ids, dtype=np.int32)[np.arange(len(cloud)) % len(ids)]
    wide = replace(cloud, classes=type(STANFORD).numbered(99), labels=labels)
    for k, part in enumerate((slice(0, 100), slice(100, 300))):
        write_pcd(folder / f"{k + 1}.pcd", wide[part], "ascii")


def test_room_is_read_from_its_pieces(tmp_path: Path) -> None:
    write_pieces(tmp_path, STANFORD_IDS)
    room = stanford_room(tmp_path)
    assert room.classes == STANFORD
    assert np.allclose(room.points, room_cloud().points, atol=1e-6)
    assert np.array_equal(room.hard_labels, np.arange(300) % len(STANFORD_IDS))


@pytest.mark.parametrize("unknown", [0, 4, 8, 10, 98])
def test_room_with_unknown_labels(tmp_path: Path, unknown: int) -> None:
    write_pieces(tmp_path, (1, 2, unknown))
    with pytest.raises(FileFormatError, match="no class of the room"):
        stanford_room(tmp_path)


def test_room_without_pieces(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no pieces"):
        stanford_room(tmp_path)


def test_octomap_figure_has_a_column_for_each_resolution() -> None:
    cloud = room_cloud()
    view = into_room(cloud.points, width=90)
    plain = opened(octomap_figure("room", "", cloud, view, (0.5, 1.0)))
    assert plain.shape[1] >= 3 * 90
    coloured = replace(cloud, colours=np.full((300, 3), (10, 200, 10), dtype=np.uint8))
    both = opened(octomap_figure("room", "", coloured, view, (0.5, 1.0)))
    assert len(both) > len(plain) + 60
    pure_green = (both[..., 1] > 2 * both[..., 0] + 60) & (both[..., 1] > 2 * both[..., 2] + 60)
    assert pure_green[len(plain) - 60 :].sum() > 1000
    with pytest.raises(InputError, match="at least one resolution"):
        octomap_figure("room", "", cloud, view, ())
    with pytest.raises(InputError, match="with labels"):
        octomap_figure("room", "", replace(cloud, labels=None), view)


def test_view_into_the_room_holds_it_all() -> None:
    points = np.random.default_rng(0).uniform((14, 1, 0), (20, 6, 2.7), (2000, 3))
    view = into_room(points)
    x, y, z = view.to_camera(points).T
    assert (z > 0).all()
    assert (np.abs(view.focal * x / z) < view.width / 2).mean() > 0.98
    assert (np.abs(view.focal * y / z) < view.height / 2).mean() > 0.98
    assert view.T_world_camera[1, 3] > 6
    assert view.T_world_camera[2, 3] > 2.7


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_pooled_diagram_is_that_of_all_points(seed: int, parts: int) -> None:
    rng = np.random.default_rng(seed)
    p = rng.dirichlet(np.ones(3), 60) * (rng.random((60, 1)) < 0.8)
    y = rng.integers(0, 3, 60)
    cuts = np.array_split(np.arange(60), parts)
    together, one_by_one = reliability(p, y), pooled([reliability(p[i], y[i]) for i in cuts])
    assert np.array_equal(together.count, one_by_one.count)
    assert np.allclose(together.confidence, one_by_one.confidence, equal_nan=True)
    assert np.allclose(together.accuracy, one_by_one.accuracy, equal_nan=True)
    assert one_by_one.ece == pytest.approx(together.ece)


def test_curves_are_pictures(results: list[Result]) -> None:
    one = opened(reliability_figure(results))
    other = [replace(result, experiment="other", n_train=9 * result.n_train) for result in results]
    two = opened(reliability_figure([*results, *other]))
    assert two.shape[0] > 1.5 * one.shape[0]
    assert two.shape[1] == one.shape[1]
    costs = opened(cost_figure([*results, *other]))
    assert len(np.unique(costs.reshape(-1, costs.shape[2]), axis=0)) > 20


def test_curves_need_results() -> None:
    for draw in (reliability_figure, cost_figure):
        with pytest.raises(InputError, match="no results"):
            draw([])


def test_curves_need_matplotlib(results: list[Result], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for draw in (reliability_figure, cost_figure):
        with pytest.raises(MissingExtraError, match=r"semgp\[figures\]"):
            draw(results)


def test_class_colours_reach_the_picture() -> None:
    view = View.look_at((0, -4, 0), (0, 0, 0), fov=30, width=48, height=36)
    drawn = draw_cubes([(0.0, 0, 0)], 1.0, by_class(np.array([4]), NYU13), view)
    middle = drawn[18, 24].astype(float)
    assert np.allclose(middle / middle.max(), np.array(NYU13.colours[4]) / max(NYU13.colours[4]), atol=0.02)
