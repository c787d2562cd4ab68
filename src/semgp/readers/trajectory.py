"""Trajectories: the poses of a sensor over time, as the TUM and the KITTI benchmarks write them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from semgp.checks import rigid_transform
from semgp.errors import FileFormatError, InputError


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The poses of a sensor.

    Parameters
    ----------
    T_world_sensor : (N, 4, 4) array
        The poses, in order.
    stamps : (N,) array, optional
        When each was taken, seconds, ascending. KITTI's files have none.
    """

    T_world_sensor: NDArray[np.float64]
    stamps: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.T_world_sensor)

    def at(self, stamp: float) -> NDArray[np.float64]:
        """Return the pose (4, 4) at a time, between its neighbours: positions linearly, rotations by slerp.

        Raises
        ------
        InputError
            A time before the first pose or after the last, or a trajectory without stamps.
        """
        if self.stamps is None:
            raise InputError("the trajectory has no stamps: take its poses by their numbers.")
        first, last = self.stamps[0], self.stamps[-1]
        if not first <= stamp <= last:
            raise InputError(
                f"there is no pose at {stamp:.6f} s: the trajectory goes from {first:.6f} to {last:.6f}."
            )
        after = int(np.searchsorted(self.stamps, stamp))
        if self.stamps[after] == stamp:
            return np.array(self.T_world_sensor[after])
        pair = slice(after - 1, after + 1)
        (t0, t1), poses = self.stamps[pair], self.T_world_sensor[pair]
        share = (stamp - t0) / (t1 - t0)
        T = np.eye(4)
        T[:3, :3] = Slerp((0, 1), Rotation.from_matrix(poses[:, :3, :3]))(share).as_matrix()
        T[:3, 3] = (1 - share) * poses[0, :3, 3] + share * poses[1, :3, 3]
        return T


def read_trajectory(path: str | Path) -> Trajectory:
    """Read a trajectory, TUM's or KITTI's by how many numbers a line has, 8 or 12.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, or neither of the two; the message names the line.
    """
    path = Path(path)
    width = len(_rows(path)[0][1])
    if width not in (8, 12):
        raise FileFormatError(path, f"has lines of {width} numbers; TUM's trajectories have 8, KITTI's 12.")
    return read_tum(path) if width == 8 else Trajectory(read_kitti_poses(path))


def read_tum(path: str | Path) -> Trajectory:
    """Read a TUM trajectory: lines `stamp tx ty tz qx qy qz qw`, seconds and metres, `#` before comments.

    Raises
    ------
    FileFormatError
        A file that is missing or damaged, stamps that do not ascend, or quaternions that are no rotations.
    """
    path = Path(path)
    lines, rows = zip(*_numbers(path))
    if odd := [line for line, row in zip(lines, rows) if len(row) != 8]:
        raise FileFormatError(path, f"line {odd[0]}: must be the eight numbers stamp tx ty tz qx qy qz qw.")
    numbers = np.array(rows)
    stamps, q = numbers[:, 0], numbers[:, 4:]
    if late := np.flatnonzero(np.diff(stamps) <= 0).tolist():
        raise FileFormatError(path, f"line {lines[late[0] + 1]}: its stamp is not after the one before.")
    with np.errstate(over="ignore"):
        length = np.linalg.norm(q, axis=1)
    if wrong := np.flatnonzero(np.abs(length - 1) > 1e-2).tolist():
        raise FileFormatError(path, f"line {lines[wrong[0]]}: qx qy qz qw must be a quaternion of length 1.")
    T = np.tile(np.eye(4), (len(numbers), 1, 1))
    T[:, :3, :3] = Rotation.from_quat(q).as_matrix()
    T[:, :3, 3] = numbers[:, 1:4]
    return Trajectory(T, stamps)


def read_kitti_poses(path: str | Path) -> NDArray[np.float64]:
    """Return the poses (N, 4, 4) of a KITTI file: on each line the first three rows of a transform, 12 numbers.

    Raises
    ------
    FileFormatError
        A file that is missing or damaged, or lines that are no rigid transforms.
    """
    path = Path(path)
    rows = _numbers(path)
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    for pose, (line, values) in zip(T, rows):
        pose[:3] = np.reshape(values, (3, 4)) if len(values) == 12 else transform_of(path, line, values)[:3]
    R = T[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
        right = (off < 1e-4) & (np.linalg.det(R) > 0)
    for i in np.flatnonzero(~right):  # the few that deserve a closer look
        transform_of(path, *rows[i])
    return T


def transform_of(path: Path, line: int, values: list[float]) -> NDArray[np.float64]:
    """Return the rigid transform (4, 4) whose first three rows a line of a file gives.

    Raises
    ------
    FileFormatError
        Another count than 12, or numbers that make no rigid transform.
    """
    if len(values) != 12:
        raise FileFormatError(path, f"line {line}: has {len(values)} numbers where a transform has 12.")
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            return rigid_transform("the transform", np.array([*values, 0, 0, 0, 1]).reshape(4, 4))
    except InputError as error:
        raise FileFormatError(path, f"line {line}: {error}") from error


def numbers_of(path: Path, line: int, words: list[str]) -> list[float]:
    """Return the numbers of a line of a file.

    Raises
    ------
    FileFormatError
        Words that are no finite numbers.
    """
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise FileFormatError(path, f"line {line}: {error}.") from error
    if not np.isfinite(values).all():
        raise FileFormatError(path, f"line {line}: has numbers that are NaN or infinite.")
    return values


def text_lines_of(path: Path) -> list[str]:
    """Return the lines of a small text file.

    Raises
    ------
    FileFormatError
        A file that is missing or no text.
    """
    try:
        return path.read_text(encoding="ascii").splitlines()
    except UnicodeDecodeError as error:
        raise FileFormatError(path, "is no text file.") from error
    except OSError as error:
        problem = "no such file" if isinstance(error, FileNotFoundError) else f"cannot be read: {error.strerror}"
        raise FileFormatError(path, f"{problem}.") from error


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return the number and the words of each line that is not blank and no comment."""
    lines = enumerate(text_lines_of(path), start=1)
    rows = [(n, line.split()) for n, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if not rows:
        raise FileFormatError(path, "is no trajectory: it has no poses.")
    return rows


def _numbers(path: Path) -> list[tuple[int, list[float]]]:
    """Return the number and the values of each line."""
    return [(n, numbers_of(path, n, words)) for n, words in _rows(path)]
