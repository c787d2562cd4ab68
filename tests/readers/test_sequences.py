"""KITTI scans alone and in sequences, and folders of point files with the poses of a trajectory."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.conventions import SEMANTIC_KITTI
from semgp.errors import FileFormatError, InputError
from semgp.readers import open_scans, read, read_kitti_bin
from semgp.readers.point_folder import natural
from semgp.writers import write_npz
from tests.reader_samples import write_kitti_bin, write_kitti_sequence, write_point_folder

# ---------------------------------------------------------------- KITTI


def test_a_bin_alone_against_its_bytes(tmp_path: Path) -> None:
    path = write_kitti_bin(tmp_path)
    cloud = read(path)
    rows = np.fromfile(path, "<f4").reshape(-1, 4)
    np.testing.assert_array_equal(cloud.points, rows[:, :3])
    np.testing.assert_array_equal(cloud.features, rows[:, 3:])
    np.testing.assert_array_equal(cloud.T_world_sensor, np.eye(4))
    names = {0: None, 10: "car", 252: "car", 40: "road"}
    raw = np.fromfile(path.with_suffix(".label"), "<u4").tolist()
    found = [SEMANTIC_KITTI.names[c] if c >= 0 else None for c in cloud.hard_labels]
    assert found == [names[i] for i in raw]


def test_a_bin_finds_labels_of_its_sequence_or_none(tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    alone, moved = read_kitti_bin(path / "velodyne" / "000001.bin"), open_scans(path)[1]
    np.testing.assert_array_equal(alone.labels, moved.labels)
    (path / "labels" / "000001.label").unlink()
    assert read_kitti_bin(path / "velodyne" / "000001.bin").labels is None


def test_labels_that_do_not_fit(tmp_path: Path) -> None:
    path = write_kitti_bin(tmp_path)
    with pytest.raises(FileFormatError, match="labels up to 252, but there are 3 classes"):
        read(path, classes=Classes.numbered(3))
    own = Classes(("thing", "ground"), ids=((10,), (40,)))
    assert set(read(path, classes=own).hard_labels.tolist()) == {-1, 0, 1}
    np.zeros(3, "<u4").tofile(path.with_suffix(".label"))
    with pytest.raises(FileFormatError, match="3 labels for the 40 points"):
        read(path)


def test_a_sequence_with_a_users_classes_poses_and_times(tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    (path / "times.txt").write_text("0.0\n1.036e-01\n2e-01\n3e-01\n")
    assert [cloud.stamp for cloud in open_scans(path)] == [0, 0.1036, 0.3]
    own = Classes(("thing", "ground"), ids=((10,), (40,)))
    for mine, theirs in zip(open_scans(path, classes=own), open_scans(path)):
        ground = theirs.hard_labels == SEMANTIC_KITTI.index("road")
        np.testing.assert_array_equal(mine.hard_labels == 1, ground)
    poses = tmp_path / "estimated.txt"
    poses.write_text("1 0 0 0 0 1 0 0 0 0 1 5\n" * 4)
    for cloud in open_scans(path, poses=poses):
        assert cloud.origin is not None
        np.testing.assert_allclose(cloud.origin, [5, 0, 0], atol=1e-12)  # 5 m along the camera's z is forward


def test_a_sequence_without_labels_has_none_unless_they_are_asked_for(tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    for label in (path / "labels").iterdir():
        label.unlink()
    with pytest.raises(FileFormatError, match=r"000000.label: no such file"):
        open_scans(path)[0]
    (path / "labels").rmdir()
    assert open_scans(path)[0].labels is None
    with pytest.raises(FileFormatError, match=r"000000.label: no such file"):
        open_scans(path, labels="labels")[0]


@pytest.mark.parametrize("text", ["0\n0.1\n0.2\n", "0\n0.1\n0.2\nsoon\n", "0\n0.1\n0.2\n\n"])
def test_times_that_do_not_fit(text: str, tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    (path / "times.txt").write_text(text)
    with pytest.raises(FileFormatError, match=r"times.txt: (has 3 rows|line 4)"):
        open_scans(path)


# ---------------------------------------------------------------- folders of point files


def test_a_folder_is_read_in_natural_order(tmp_path: Path) -> None:
    path = write_point_folder(tmp_path)
    assert [len(cloud) for cloud in open_scans(path)] == [9, 10, 11]
    ordered = ["2.ply", "010.ply", "a9b2.ply", "a9b11.ply", "a10b2.ply", "b.ply"]
    assert [file.name for file in sorted(map(Path, sorted(ordered)), key=natural)] == ordered


def poses(folder: Path, stamps: list[float] | None) -> tuple[Path, NDArray[np.float64]]:
    """Write three poses, each turned by a right angle about z and a step of one metre further."""
    half = np.sqrt(0.5)
    T = np.tile(np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), (3, 1, 1))
    T[:, 2, 3] = (1, 2, 3)
    if stamps is None:
        lines = [" ".join(map(str, pose[:3].ravel())) for pose in T]
    else:
        lines = [f"{stamp:.6f} 0 0 {z} 0 0 {half} {half}" for stamp, z in zip(stamps, (1, 2, 3))]
    (folder / "poses.txt").write_text("\n".join(lines) + "\n")
    return folder / "poses.txt", T


@pytest.mark.parametrize("stamps", [None, [5.0, 6.0, 7.0]])
def test_poses_in_order(stamps: list[float] | None, tmp_path: Path) -> None:
    path = write_point_folder(tmp_path)
    file, T = poses(path, stamps)  # beside the point files, where a .txt is none of them
    for i, (here, there) in enumerate(zip(open_scans(path), open_scans(path, poses=file))):
        np.testing.assert_allclose(there.points, here.points @ T[i, :3, :3].T + T[i, :3, 3], atol=1e-12)
        np.testing.assert_allclose(np.array(there.T_world_sensor), T[i], atol=1e-12)
        assert there.stamp == (None if stamps is None else stamps[i])
        np.testing.assert_array_equal(there.labels, here.labels)


@pytest.mark.parametrize("unit", ["seconds", "nanoseconds"])
def test_poses_by_stamp(unit: str, tmp_path: Path) -> None:
    path = write_point_folder(tmp_path)
    start = 1311868164.0
    file, T = poses(tmp_path, [start, start + 1, start + 3])
    for name, share in (("9", 0.25), ("10", 1.0), ("11", 2.0)):
        stamp = start + share
        new = f"{stamp:.6f}.pcd" if unit == "seconds" else f"{stamp * 1e9:.0f}.pcd"
        (path / f"{name}.pcd").rename(path / new)
    clouds = open_scans(path, poses=file)
    assert [len(cloud) for cloud in clouds] == [9, 10, 11]
    heights = [cloud.origin[2] for cloud in clouds if cloud.origin is not None]
    np.testing.assert_allclose(heights, [1.25, 2, 2.5], atol=1e-5)
    np.testing.assert_allclose(clouds[1].stamp or 0, start + 1, atol=1e-5)
    np.testing.assert_allclose(np.array(clouds[0].T_world_sensor)[:3, :3], T[0, :3, :3], atol=1e-9)
    (path / f"{start + 9:.6f}.pcd").write_bytes(next(path.iterdir()).read_bytes())
    with pytest.raises(FileFormatError, match=r"poses.txt: there is no pose at 1311868173"):
        open_scans(path, poses=file)


def test_a_sensors_place_in_the_file_is_kept(tmp_path: Path) -> None:
    T_file_sensor = np.eye(4)
    T_file_sensor[:3, 3] = (1, 0, 0)
    for i in range(3):
        write_npz(
            tmp_path / f"{i}.npz",
            LabelledCloud(np.ones((2, 3)), Classes.numbered(2), T_world_sensor=T_file_sensor),
        )
    file, T = poses(tmp_path, None)
    found = open_scans(tmp_path, poses=file)[2].T_world_sensor
    np.testing.assert_allclose(np.array(found), T[2] @ T_file_sensor)


def test_folders_that_are_refused(tmp_path: Path) -> None:
    path = write_point_folder(tmp_path)
    file, _ = poses(tmp_path, None)
    file.write_text(file.read_text() * 2)
    with pytest.raises(FileFormatError, match="6 poses for 3 point files"):
        open_scans(path, poses=file)
    with pytest.raises(InputError, match="'world'; the formats that have it: semantickitti"):
        open_scans(path, world="camera")
    write_npz(path / "a.npz", LabelledCloud(np.ones((2, 3)), Classes.numbered(2)))
    with pytest.raises(FileFormatError, match=r"one format, but has 3 .pcd, 1 .npz"):
        open_scans(path)


def test_a_folder_of_text_files_with_its_poses(tmp_path: Path) -> None:
    for name in ("2.txt", "10.txt", "1.txt"):
        (tmp_path / name).write_text(f"{name[:-4]} 0 0\n")
    file, _ = poses(tmp_path, None)
    found = [cloud.points[0, 1] for cloud in open_scans(tmp_path, poses=file)]
    np.testing.assert_allclose(found, [1, 2, 10])  # x turned to y
    (tmp_path / "a.csv").write_text("x,y,z\n0,0,0\n")
    with pytest.raises(FileFormatError, match=r"3 .txt, 1 .csv|1 .csv, 3 .txt"):
        open_scans(tmp_path, poses=file)


def test_options_go_to_the_files(tmp_path: Path) -> None:
    path = write_point_folder(tmp_path)
    own = Classes(("a", "b", "c"))
    assert all(cloud.classes == own for cloud in open_scans(path, classes=own))
    for file in path.iterdir():
        file.unlink()
    write_npz(path / "a.npz", LabelledCloud(np.ones((2, 3)), own))
    with pytest.raises(InputError, match="npz of its files has no option 'features'"):
        open_scans(path, features=["x"])


def test_real_folders(data_dir: Path) -> None:
    pieces = open_scans(data_dir / "stanford_room", classes=Classes.numbered(14))
    assert len(pieces) == 34
    assert len(pieces[0]) == 51260  # 1.pcd, and next is 2.pcd, not 10.pcd
    assert len(pieces[1]) == len(read(data_dir / "stanford_room" / "2.pcd"))
    with pytest.raises(InputError, match="give the folder"):
        open_scans(data_dir / "semantickitti_08" / "velodyne")
