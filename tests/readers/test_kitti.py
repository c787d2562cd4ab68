"""Sequences of SemanticKITTI."""

from pathlib import Path

import numpy as np
import pytest

from semgp.conventions import (
    SEMANTIC_KITTI,
    SEMANTIC_KITTI_IDS,
)
from semgp.errors import FileFormatError, InputError
from semgp.readers import SemanticKITTISequence, open_scans
from tests.reader_samples import (
    TR,
    write_kitti_sequence,
)


@pytest.mark.parametrize("world", ["velodyne", "camera"])
def test_kitti_against_a_loop(world: str, tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    scans = open_scans(path, world=world)
    assert len(scans) == 3
    kinds = {raw: name for name, ids in SEMANTIC_KITTI_IDS.items() for raw in ids}
    for cloud, number in zip(scans, (0, 1, 3)):
        rows = np.fromfile(path / "velodyne" / f"{number:06d}.bin", "<f4").reshape(-1, 4)
        ids = np.fromfile(path / "labels" / f"{number:06d}.label", "<u4") & 0xFFFF
        P = np.eye(4)
        P[2, 3] = number
        T = P @ TR if world == "camera" else np.linalg.inv(TR) @ P @ TR
        np.testing.assert_allclose(np.array(cloud.T_world_sensor), T, atol=1e-12)
        for n, (row, raw) in enumerate(zip(rows, ids.tolist())):
            np.testing.assert_allclose(cloud.points[n], (T @ [*row[:3], 1])[:3], atol=1e-9)
            label = cloud.hard_labels[n]
            assert (SEMANTIC_KITTI.names[label] if label >= 0 else None) == kinds.get(raw)
        np.testing.assert_array_equal(cloud.features, rows[:, 3:])
        assert cloud.feature_names == ("intensity",)


def test_kitti_velodyne_world_moves_along_x(tmp_path: Path) -> None:
    sequence = SemanticKITTISequence(write_kitti_sequence(tmp_path))
    np.testing.assert_allclose([T[:3, 3] for T in sequence.T_world_sensor], [[0, 0, 0], [1, 0, 0], [3, 0, 0]])


def test_kitti_labels_from_elsewhere_or_none(tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    sequence = SemanticKITTISequence(path)
    (path / "predictions").rename(tmp_path / "mine")
    predicted = sequence.scan(1, labels=tmp_path / "mine")
    assert (predicted.hard_labels != sequence.scan(1).hard_labels).any()
    assert sequence.scan(1, labels=None).labels is None
    with pytest.raises(FileFormatError, match=r"predictions.000001.label: no such file"):
        sequence.scan(1, labels="predictions")
    with pytest.raises(InputError, match="no scan 3"):
        sequence.scan(3)


def test_kitti_poses_of_the_odometry_benchmark(tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    expected = SemanticKITTISequence(path).T_world_sensor
    (tmp_path / "dataset" / "poses").mkdir()
    (path / "poses.txt").rename(tmp_path / "dataset" / "poses" / "08.txt")
    np.testing.assert_array_equal(SemanticKITTISequence(path).T_world_sensor, expected)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n" * 3, "has 3 rows, but scan 000003.bin needs row 4"),
        ("poses.txt", "1 0 0\n" * 4, "3 numbers where a transform has 12"),
        ("poses.txt", "1 0 0 0 0 2 0 0 0 0 1 0\n" * 4, "no rigid transform"),
        ("poses.txt", "a b c d e f g h i j k l\n" * 4, "could not convert"),
        ("poses.txt", "nan 0 0 0 0 1 0 0 0 0 1 0\n" * 4, "NaN"),
        ("poses.txt", "é", "no text file"),
        ("calib.txt", "P0: 1 2 3\n", "no line 'Tr: ...'"),
        ("calib.txt", "Tr: 1 2 3\n", "3 numbers"),
        ("velodyne/000001.bin", "x" * 17, "no positive multiple of 16"),
        ("velodyne/000001.bin", "\xff" * 16, "NaN or infinite"),
        ("velodyne/000001.bin", "", "no positive multiple of 16"),
        ("velodyne/scan.bin", "x" * 16, "named by its number"),
        ("labels/000001.label", "x" * 8, "has 2 labels for the 51 points"),
        ("labels/000001.label", "x" * 7, "no positive multiple of 4"),
    ],
)
def test_kitti_says_what_is_wrong(name: str, content: str, message: str, tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    (path / name).write_text(content, encoding="latin-1")
    with pytest.raises(FileFormatError, match=message) as caught:
        list(open_scans(path))
    assert str(path / name) in str(caught.value)


def test_kitti_bad_options(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'velodyne' or 'camera'"):
        open_scans(write_kitti_sequence(tmp_path), world="moon")
    with pytest.raises(FileFormatError, match=r"no velodyne/\*.bin"):
        SemanticKITTISequence(tmp_path)


def test_kitti_real_scans(data_dir: Path) -> None:
    scans = open_scans(data_dir / "semantickitti_08")
    assert len(scans) == 10
    first, last = scans[0], scans[-1]
    assert len(first) == 1_974_224 // 16
    np.testing.assert_allclose(np.array(first.T_world_sensor), np.eye(4), atol=1e-6)
    assert last.origin is not None
    assert 5 < last.origin[0] < 12
    assert abs(last.origin[2]) < 0.5
    road = SEMANTIC_KITTI.index("road")
    for cloud in (first, last):  # the lidar rides 1.73 m above the road, and z is up
        assert abs(np.median(cloud.points[cloud.hard_labels == road, 2]) + 1.73) < 0.2
    predicted = open_scans(data_dir / "semantickitti_08", labels="predictions")[0]
    both = first.labelled
    assert 0.7 < (predicted.hard_labels == first.hard_labels)[both].mean() < 0.95
