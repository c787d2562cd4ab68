"""Intrinsics and poses of RGB-D folders in text files: matrices, `.log` trajectories and Open3D's json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.camera import Pinhole
from semgp.checks import rigid_transform
from semgp.errors import FileFormatError, InputError

Pose = NDArray[np.float64] | None
"""A camera's pose in the world, (4, 4); None where it is not finite, as trackers write when they are lost."""


def pose_file(path: Path) -> Pose:
    """Return a camera's pose in the world, a 4 x 4 matrix in text; None where it is not finite.

    Raises
    ------
    FileFormatError
        A file that is missing, or holds no pose.
    """
    return _pose(path, matrix_file(path, (16,)))


def camera_file(path: Path) -> Pinhole:
    """Return the intrinsics in a text file of a 3 x 3 or 4 x 4 matrix."""
    return _camera(path, matrix_file(path, (9, 16)))


def matrix_file(path: Path, sizes: tuple[int, ...]) -> NDArray[np.float64]:
    """Return the square matrix in a text file that has one of some numbers of entries."""
    try:
        numbers = np.array(path.read_text(encoding="ascii").split(), dtype=np.float64)
    except (OSError, ValueError) as error:
        raise FileFormatError(path, f"is no matrix in text: {error}") from error
    if len(numbers) not in sizes:
        raise FileFormatError(path, f"has {len(numbers)} numbers, where a matrix has {sizes[-1]}.")
    n = round(len(numbers) ** 0.5)
    return numbers.reshape(n, n)


def log_poses(path: Path) -> list[Pose]:
    """Return the camera-to-world poses of a `.log` trajectory: a line of counts, then four of a matrix each."""
    try:
        lines = [line.split() for line in path.read_text(encoding="ascii").splitlines() if line.strip()]
        matrices = [np.array(lines[i + 1 : i + 5], dtype=np.float64) for i in range(0, len(lines), 5)]
    except (OSError, ValueError) as error:
        raise FileFormatError(path, f"is no trajectory .log: {error}") from error
    if any(T.shape != (4, 4) for T in matrices):
        raise FileFormatError(
            path, "is no trajectory .log: a pose is five lines, one of counts, four of a matrix."
        )
    return [_pose(path, T) for T in matrices]


def _read_json(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise FileFormatError(path, f"cannot be read as JSON: {error}") from error


def json_poses(path: Path) -> list[Pose]:
    """Return the camera-to-world poses of a PinholeCameraTrajectory, whose extrinsics are world to camera."""
    content = _read_json(path)
    try:
        extrinsics = [_column_major(camera["extrinsic"], 4) for camera in content["parameters"]]
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(path, f"is no PinholeCameraTrajectory of Open3D: {error!r}.") from error
    poses = (_pose(path, T_camera_world) for T_camera_world in extrinsics)
    return [None if T is None else np.asarray(np.linalg.inv(T), dtype=np.float64) for T in poses]


def json_camera(path: Path) -> Pinhole:
    """Return the intrinsics of a camera file, or those of a trajectory's first camera."""
    content = _read_json(path)
    try:
        intrinsic = content["parameters"][0]["intrinsic"] if "parameters" in content else content
        K = _column_major(intrinsic["intrinsic_matrix"], 3)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise FileFormatError(path, f"has no intrinsic_matrix of 9 numbers: {error!r}.") from error
    return _camera(path, K)


def _column_major(numbers: ArrayLike, n: int) -> NDArray[np.float64]:
    return np.array(numbers, dtype=np.float64).reshape(n, n).T


def _camera(path: Path, K: NDArray[np.float64]) -> Pinhole:
    try:
        return Pinhole(*map(float, (K[0, 0], K[1, 1], K[0, 2], K[1, 2])))
    except InputError as error:
        raise FileFormatError(path, str(error)) from error


def _pose(path: Path, T: NDArray[np.float64]) -> Pose:
    if not np.isfinite(T).all():
        return None
    try:
        return rigid_transform("the pose", T)
    except InputError as error:
        raise FileFormatError(path, str(error)) from error
