"""The map of many blocks: nothing but the data decides its answers; borders do not show; it lives on."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from semgp.blocks.cells import CELL
from semgp.blocks.learning import class_frequencies, learn_from_scans
from semgp.blocks.model import BlockModel
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.evaluation.semantic_kitti import VERTICAL, kitti_task
from semgp.gp.stationary import Matern52
from semgp.maps.files import load_map, save_map
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR, with_vertical
from semgp.parallel import n_workers
from semgp.prediction import Prediction
from semgp.readers import SemanticKITTISequence
from semgp.scene.lidar import Lidar
from semgp.scene.town import SyntheticTown

MODEL = OUTDOOR_LIDAR


@pytest.fixture(scope="module")
def scans() -> list[LabelledCloud]:
    town = SyntheticTown(lidar=Lidar(beams=24, columns=500))
    seen = [town.scan(4 * i).observed for i in range(4)]
    # walls stand on whole decimetres, where rounding decides the voxel: move the world off them
    return [replace(s, points=s.points + np.array([0.0137, 0.0071, 0.0053])) for s in seen]


def built(scans: list[LabelledCloud], model: BlockModel = MODEL, tolerance: float = 0.0) -> GPSemanticMap:
    gp_map = GPSemanticMap(scans[0].classes, model, tolerance)
    for scan in scans:
        gp_map.update(scan)
    return gp_map


def assert_same(a: Prediction, b: Prediction, atol: float = 1e-9) -> None:
    np.testing.assert_allclose(a.probability, b.probability, atol=atol)
    np.testing.assert_allclose(a.variance, b.variance, atol=atol)  # type: ignore[arg-type]


def test_any_order_of_updates(scans: list[LabelledCloud]) -> None:
    queries = scans[1].points[::7]
    forward, backward = built(scans), built(scans[::-1])
    backward.query(queries[:100])  # asked in between
    backward.update(scans[2][:0])
    assert_same(forward.query(queries), backward.query(queries))


@pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity") or n_workers() < 2, reason="needs two cores to compare with"
)
def test_any_number_of_threads(scans: list[LabelledCloud]) -> None:
    queries, cores = scans[1].points[::7], os.sched_getaffinity(0)
    many = built(scans).query(queries)
    try:
        os.sched_setaffinity(0, {min(cores)})
        one = built(scans).query(queries)
    finally:
        os.sched_setaffinity(0, cores)
    assert_same(many, one)


def test_a_world_moved_by_whole_cells_to_utm_coordinates(scans: list[LabelledCloud]) -> None:
    shift = np.round(np.array([5e5, 5e6, 0]) / (CELL * MODEL.resolution)) * CELL * MODEL.resolution
    moved = [replace(s, points=s.points + shift, T_world_sensor=None) for s in scans]
    queries = scans[1].points[::7]
    assert_same(built(scans).query(queries), built(moved).query(queries + shift), atol=1e-5)


def steps_across_and_inside(gp_map: GPSemanticMap, points: np.ndarray, metres: float) -> tuple[float, float]:
    """Mean change of the probabilities over a step, where it leaves the block of its start and where not."""
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(len(points), 2))
    step = np.zeros_like(points)
    step[:, :2] = metres * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    change = np.abs(gp_map.query(points).probability - gp_map.query(points + step).probability).sum(axis=1)
    field = gp_map._state._field  # type: ignore[union-attr]
    across = field.home(points)[0] != field.home(points + step)[0]
    return float(change[across].mean()), float(change[~across].mean())


@pytest.mark.parametrize("metres", [0.02, 0.05, 0.1])
def test_borders_between_blocks_do_not_show(scans: list[LabelledCloud], metres: float) -> None:
    points = np.concatenate([s.points[s.labelled] for s in scans])
    across, inside = steps_across_and_inside(built(scans), points, metres)
    assert across < 1.5 * inside
    hard_across, hard_inside = steps_across_and_inside(built(scans, replace(MODEL, blend=1e-3)), points, metres)
    assert hard_across > 1.5 * hard_inside  # without blending they do


def test_seen_again_it_is_surer_and_no_larger(scans: list[LabelledCloud]) -> None:
    gp_map = built(scans[:1])
    before, size = gp_map.query(scans[0].points), len(gp_map)
    for _ in range(3):
        gp_map.update(scans[0])
    after = gp_map.query(scans[0].points)
    assert len(gp_map) == size
    assert after.variance is not None
    assert before.variance is not None
    assert after.variance.mean() < before.variance.mean()


def test_tolerance_saves_work_and_changes_little(scans: list[LabelledCloud]) -> None:
    exact, live = built(scans[:3]), built(scans[:3], tolerance=0.3)
    for gp_map in (exact, live):
        gp_map.solve()
        gp_map.update(scans[3])
        gp_map.solve()
    assert live.info()["cells_to_solve"] > exact.info()["cells_to_solve"] == 0
    a, b = exact.query(scans[3].points), live.query(scans[3].points)
    assert np.abs(a.probability - b.probability).mean() < 0.02


def test_crop_keeps_what_lies_inside(scans: list[LabelledCloud], tmp_path: Path) -> None:
    gp_map = built(scans)
    low, high = np.array([-10.0, -10, -5]), np.array([10.0, 10, 5])
    part = gp_map.crop(low, high)
    inside = ((low <= gp_map.positions) & (gp_map.positions < high)).all(axis=1)
    assert len(part) == np.count_nonzero(inside)
    far_in = scans[0].points[(np.abs(scans[0].points[:, :2]) < 4).all(axis=1)]
    change = np.abs(part.query(far_in).probability - gp_map.query(far_in).probability)
    assert change.mean() < 0.005
    save_map(part, tmp_path / "part.semgp")
    again = load_map(tmp_path / "part.semgp")
    again.update(scans[0])
    assert len(again) > len(part)
    with pytest.raises(InputError, match="two corners"):
        gp_map.crop(high, low)


def test_colours_are_inputs_like_any_other(corner: LabelledCloud) -> None:
    colours = np.random.default_rng(0).integers(0, 255, (360, 3)).astype(np.uint8)
    red = replace(corner, labels=(colours[:, 0] > 127).astype(int), colours=colours)
    with_red = BlockModel(Matern52((1.0, 1.0, 1.0, 0.2), 0.5), resolution=0.02, features=("red",), leaf=200)
    gp_map = built([red], with_red)
    known = gp_map.query(red.points + 0.001, colours[:, :1] / 255)
    assert (known.label == red.hard_labels).mean() > 0.9
    assert gp_map.query(red.points).probability.shape == (360, 3)  # without colour: that of the nearest member
    with pytest.raises(InputError, match="features must have shape"):
        gp_map.query(red.points, colours / 255)
    with pytest.raises(InputError, match="asks for the feature 'red'"):
        built([replace(red, colours=None)], with_red)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda c: GPSemanticMap(c, BlockModel(prior=(0.5, 0.5))), "2 classes, the map has 3"),
        (lambda c: GPSemanticMap(c, tolerance=-1.0), "tolerance"),
        (lambda c: GPSemanticMap(c, cast("Any", "paper")), "BlockModel or a GPModel"),
    ],
)
def test_bad_settings(corner: LabelledCloud, make: Callable[[Any], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(corner.classes)


class TestSemanticKITTI:
    """Two scans in a hundredth of their labels: quick, and more accurate than the labels."""

    def test_learned_map_beats_its_labels(self, data_dir: Path) -> None:
        folder = data_dir / "semantickitti_08"
        if not folder.is_dir():
            pytest.skip(f"{folder} is not there")
        task = kitti_task(SemanticKITTISequence(folder, world="camera"), keep=0.05, scans=3)
        start = with_vertical(OUTDOOR_LIDAR, VERTICAL)
        model, info = learn_from_scans(task.training, start, vertical=VERTICAL, patches=60, max_iterations=4)
        assert info.log_loss <= info.start_log_loss
        assert model.prior == class_frequencies(task.training)
        truth = task.truth[task.truth.hard_labels >= 0]
        label = built(list(task.training), model).query(truth.points).label
        assert (label == truth.hard_labels).mean() > 0.87  # the network's own: 0.84
