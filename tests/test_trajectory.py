"""Trajectories: what is read, what lies between two poses, and what is refused."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgp.errors import FileFormatError, InputError
from semgp.readers.trajectory import Trajectory, read_kitti_poses, read_trajectory, read_tum

HALF = np.sqrt(0.5)
TUM = f"""# stamp tx ty tz qx qy qz qw
10.0 0 0 0 0 0 0 1

10.5 1 2 3 0 0 {HALF} {HALF}
12.0 1 2 4 0 0 -{HALF} -{HALF}
"""
KITTI = "1 0 0 0.5 0 1 0 0 0 0 1 0\n0 -1 0 1 1 0 0 2 0 0 1 3\n"


def written(folder: Path, text: str) -> Path:
    (folder / "trajectory.txt").write_text(text, encoding="latin-1")
    return folder / "trajectory.txt"


def quaternion_power(q: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Return the rotation matrix a share of the way from no rotation to q (x, y, z, w), by axis and angle."""
    half = np.arctan2(np.linalg.norm(q[:3]), abs(q[3])) * share
    axis = np.sign(q[3]) * q[:3] / np.linalg.norm(q[:3])
    (x, y, z), w = np.sin(half) * axis, np.cos(half)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_tum(tmp_path: Path) -> None:
    trajectory = read_tum(written(tmp_path, TUM))
    assert trajectory.stamps is not None
    np.testing.assert_array_equal(trajectory.stamps, [10, 10.5, 12])
    turned = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(trajectory.T_world_sensor[0], np.eye(4))
    np.testing.assert_allclose(trajectory.T_world_sensor[1], turned, atol=1e-12)
    np.testing.assert_allclose(trajectory.T_world_sensor[2, :3, :3], np.array(turned)[:3, :3], atol=1e-12)


def test_kitti(tmp_path: Path) -> None:
    poses = read_kitti_poses(written(tmp_path, KITTI))
    np.testing.assert_array_equal(poses[0], [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    np.testing.assert_array_equal(poses[1], [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])


def test_the_kind_is_told_from_the_lines(tmp_path: Path) -> None:
    assert read_trajectory(written(tmp_path, TUM)).stamps is not None
    assert read_trajectory(written(tmp_path, KITTI)).stamps is None
    assert len(read_trajectory(written(tmp_path, KITTI))) == 2
    with pytest.raises(FileFormatError, match="lines of 3 numbers"):
        read_trajectory(written(tmp_path, "1 2 3\n"))


@given(
    q=st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(
        lambda q: np.linalg.norm(q[:3]) > 0.1 and abs(q[3]) > 0.1
    ),
    share=st.floats(0, 1),
)
def test_poses_in_between(q: list[float], share: float) -> None:
    unit = np.array(q) / np.linalg.norm(q)
    T = np.tile(np.eye(4), (2, 1, 1))
    T[1, :3, :3], T[1, :3, 3] = Rotation.from_quat(unit).as_matrix(), (2, -4, 6)
    at = Trajectory(T, np.array([3.0, 5.0])).at(3 + 2 * share)
    np.testing.assert_allclose(at[:3, :3], quaternion_power(unit, share), atol=1e-9)
    np.testing.assert_allclose(at[:3, 3], share * np.array([2, -4, 6]), atol=1e-9)


def test_poses_at_the_stamps_and_beyond(tmp_path: Path) -> None:
    trajectory = read_tum(written(tmp_path, TUM))
    for stamp, pose in zip((10, 10.5, 12), trajectory.T_world_sensor):
        np.testing.assert_array_equal(trajectory.at(stamp), pose)
    trajectory.at(10)[0, 3] = 7  # a copy
    assert trajectory.T_world_sensor[0, 0, 3] == 0
    for stamp in (9.99, 12.01, float("nan")):
        with pytest.raises(InputError, match="no pose at"):
            trajectory.at(stamp)
    with pytest.raises(InputError, match="no stamps"):
        read_trajectory(written(tmp_path, KITTI)).at(10)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no poses"),
        ("# only a comment\n", "no poses"),
        ("é", "no text file"),
        ("1 0 0 0 0 0 0 x\n", "line 1: could not convert"),
        ("1 0 0 0 0 0 0 1\n2 0 0 nan 0 0 0 1\n", "line 2: has numbers that are NaN"),
        ("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n", "line 2: must be the eight numbers"),
        ("1 0 0 0 0 0 0 1\n\n1 0 0 0 0 0 0 1\n", "line 3: its stamp is not after"),
        ("1 0 0 0 1e200 0 0 1\n", "line 1: qx qy qz qw"),
        ("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 0\n", "line 2: qx qy qz qw"),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0\n", "line 2: has 8 numbers"),
        ("1e200 0 0 0 0 1e300 0 0 0 -1e300 1e200 0\n", "line 1: the transform is no rigid transform"),
        ("1 0 0 0 0 1 0 0 0 0 2 0\n", "line 1: the transform is no rigid transform"),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n-1 0 0 0 0 1 0 0 0 0 1 0\n", "line 2: the transform is no rigid transform"),
    ],
)
def test_refused(text: str, message: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_trajectory(path)
    assert str(path) in str(caught.value)


def test_refused_files(tmp_path: Path) -> None:
    for path in (tmp_path / "nothing.txt", tmp_path):
        with pytest.raises(FileFormatError, match=r"no such file|cannot be read"):
            read_trajectory(path)


@given(st.binary(max_size=80))
def test_any_bytes_are_poses_or_refused(raw: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "t.txt"
        path.write_bytes(raw)
        try:
            trajectory = read_trajectory(path)
        except FileFormatError:
            return
        assert np.isfinite(trajectory.T_world_sensor).all()


def test_real_poses(data_dir: Path) -> None:
    path = data_dir / "semantickitti_08" / "poses.txt"
    poses = read_kitti_poses(path)
    naive = [np.array(line.split(), float).reshape(3, 4) for line in path.read_text().splitlines()]
    np.testing.assert_array_equal(poses[:, :3], naive)
