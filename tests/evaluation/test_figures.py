"""Rows of maps: colours, truth, methods and entropy."""

from dataclasses import replace

import numpy as np
import pytest

from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.conventions import NYU13
from semgp.errors import InputError
from semgp.evaluation.figures import camera_view, map_row, maps_figure, only, picture_figure, street_view
from semgp.evaluation.task import Result
from semgp.picture import GREY
from tests.evaluation.pictures import opened
from tests.results import patches_task, results_of


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
