"""The SemanticKITTI experiment: its tasks on a small sequence, its numbers on the real one."""

from pathlib import Path

import numpy as np
import pytest

from semgp.classes import MISSING
from semgp.conventions import SEMANTIC_KITTI
from semgp.errors import FileFormatError, InputError
from semgp.evaluation.auc import mean_of_known
from semgp.evaluation.metrics import accuracy, confusion, iou
from semgp.evaluation.semantic_kitti import METHODS, kitti_sequence, kitti_task
from semgp.evaluation.task import Task, run
from tests.reader_samples import write_kitti_sequence

POINTS = (50, 51, 53)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_kitti_sequence(tmp_path)


def test_dense_task_is_all_scans_in_one_world(folder: Path) -> None:
    sequence = kitti_sequence(folder)
    task = kitti_task(sequence)
    assert [len(cloud) for cloud in task.training] == list(POINTS)
    assert (task.name, task.experiment) == ("08", "keep-1")
    assert np.array_equal(task.truth.points, np.concatenate([cloud.points for cloud in task.training]))
    assert np.array_equal(task.truth.hard_labels, np.concatenate([sequence.scan(i).hard_labels for i in range(3)]))
    predicted = sequence.scan(1, "predictions").hard_labels
    assert np.array_equal(task.training[1].hard_labels, predicted)
    assert not np.array_equal(predicted, sequence.scan(1).hard_labels)


def test_world_is_that_of_the_poses(folder: Path) -> None:
    # the sample's cameras stand a metre apart along their z axes; row 3 belongs to the third scan
    T = [cloud.T_world_sensor for cloud in kitti_task(kitti_sequence(folder)).training]
    origins = np.array([np.asarray(pose)[:3, 3] for pose in T])
    assert np.allclose(origins - origins[0], [(0, 0, 0), (0, 0, 1), (0, 0, 3)])


@pytest.mark.parametrize("keep", [0.5, 0.1, 1e-6])
def test_a_share_of_each_scan_is_kept(folder: Path, keep: float) -> None:
    sequence = kitti_sequence(folder)
    everything, some = kitti_task(sequence), kitti_task(sequence, keep, seed=3)
    for whole, part, n in zip(everything.training, some.training, POINTS):
        assert len(part) == max(1, round(keep * n))
        places = [int(np.flatnonzero((whole.points == point).all(axis=1))[0]) for point in part.points]
        assert places == sorted(set(places))
        assert np.array_equal(part.hard_labels, whole.hard_labels[places])
    assert len(some.truth) == sum(POINTS)
    assert some.experiment == f"keep-{keep:g}"


def test_draws_follow_the_seed(folder: Path) -> None:
    sequence = kitti_sequence(folder)

    def drawn(seed: int) -> list[np.ndarray]:
        return [cloud.points for cloud in kitti_task(sequence, 0.2, seed).training]

    assert all(np.array_equal(a, b) for a, b in zip(drawn(1), drawn(1)))
    assert not any(np.array_equal(a, b) for a, b in zip(drawn(1), drawn(2)))


def test_only_the_first_scans(folder: Path) -> None:
    task = kitti_task(kitti_sequence(folder), scans=2)
    assert len(task.training) == 2
    assert len(task.truth) == sum(POINTS[:2])


@pytest.mark.parametrize("keep", [0.0, -0.5, 1.01, float("nan")])
def test_impossible_shares(folder: Path, keep: float) -> None:
    with pytest.raises(InputError, match="share of points"):
        kitti_task(kitti_sequence(folder), keep)


@pytest.mark.parametrize("scans", [0, -1, 4])
def test_impossible_numbers_of_scans(folder: Path, scans: int) -> None:
    with pytest.raises(InputError, match="ask for 1 to 3"):
        kitti_task(kitti_sequence(folder), scans=scans)


def test_a_sequence_without_predictions(folder: Path) -> None:
    (folder / "predictions" / "000001.label").unlink()
    with pytest.raises(FileFormatError, match="no such file"):
        kitti_task(kitti_sequence(folder))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_answers(folder: Path, method: str) -> None:
    result = run(kitti_task(kitti_sequence(folder)), method, METHODS[method])
    labelled = sum(int(cloud.labelled.sum()) for cloud in kitti_task(kitti_sequence(folder)).training)
    assert result.n_train == labelled
    assert 0 < result.scores.coverage <= 1
    assert result.row()["n_query"] == result.scores.n_points


def test_labels_are_the_networks_own(folder: Path) -> None:
    task = kitti_task(kitti_sequence(folder))
    predicted = np.concatenate([cloud.hard_labels for cloud in task.training])
    known = (task.truth.hard_labels != MISSING) & (predicted != MISSING)
    at = task.truth.points[known]
    answer = METHODS["labels"](task).semantic_map.query(at)
    assert np.array_equal(answer.label, predicted[known])


@pytest.fixture(scope="module")
def real_task(data_dir: Path) -> Task:
    return kitti_task(kitti_sequence(data_dir / "semantickitti_08"))


@pytest.mark.parametrize(
    ("method", "miou", "right"),
    [
        ("labels", 0.3800, 0.8414),
        ("csm", 0.3963, 0.8624),
        ("bki", 0.4026, 0.8686),
        ("knn", 0.4044, 0.8634),
    ],
)
def test_rivals_reach_their_numbers(real_task: Task, method: str, miou: float, right: float) -> None:
    known = real_task.truth.hard_labels != MISSING
    answer = METHODS[method](real_task).semantic_map.query(real_task.truth.points[known])
    table = confusion(answer.label, real_task.truth.hard_labels[known], len(SEMANTIC_KITTI))
    assert mean_of_known(iou(table)) == pytest.approx(miou, abs=0.005)
    assert accuracy(table) == pytest.approx(right, abs=0.003)
