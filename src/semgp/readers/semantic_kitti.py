"""SemanticKITTI (Behley et al., 2019): lidar scans with poses, true labels and a network's predictions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from semgp.checks import rigid_transform
from semgp.cloud import LabelledCloud
from semgp.conventions import SEMANTIC_KITTI, labels_from_semantic_kitti
from semgp.errors import FileFormatError, InputError
from semgp.readers.protocol import Scans

World = Literal["velodyne", "camera"]


class SemanticKITTISequence:
    """One sequence: `velodyne/*.bin`, `calib.txt`, `poses.txt`, and folders of labels such as `labels/*.label`.

    As the data set ships it, this is a folder `sequences/NN`; where that has no `poses.txt`, the poses of the
    KITTI odometry benchmark, `../../poses/NN.txt`, are taken. The number that names a scan's file is the row
    of its pose, so a sequence may hold any part of the scans.

    Parameters
    ----------
    path : str or Path
        The folder.
    world : "velodyne" or "camera"
        The world frame. Row i of the poses is P_i, the camera at scan i in the camera's frame at scan 0
        (z forward); Tr of the calibration takes the lidar's frame to the camera's. "camera" gives
        T_world_sensor = P_i Tr. "velodyne" gives Tr^-1 P_i Tr: the world is the lidar's frame at scan 0,
        x forward and z up, as ROS REP-103 demands.

    Raises
    ------
    InputError
        Another world.
    FileFormatError
        Files that are missing or damaged, or fewer poses than scans.
    """

    def __init__(self, path: str | Path, world: World = "velodyne") -> None:
        if world not in ("velodyne", "camera"):
            raise InputError(f"the world frame is 'velodyne' or 'camera', not {world!r}.")
        self.path = Path(path)
        self._files = sorted((self.path / "velodyne").glob("*.bin"))
        if not self._files:
            raise FileFormatError(self.path, "is no SemanticKITTI sequence: it has no velodyne/*.bin.")
        poses = _read_poses(self.path, self._files)
        Tr = _read_calibration(self.path / "calib.txt")
        self.T_world_sensor = (np.linalg.inv(Tr) if world == "velodyne" else np.eye(4)) @ poses @ Tr

    def __len__(self) -> int:
        return len(self._files)

    def scan(self, i: int, labels: str | Path | None = "labels") -> LabelledCloud:
        """Read scan i, in the world frame, with the remission as feature "intensity".

        Parameters
        ----------
        i : int
            Position among the sequence's scans, from 0.
        labels : str or Path, optional
            Folder of the label files, within the sequence or elsewhere: "labels" is the truth, "predictions"
            what a network said. None reads no labels.

        Raises
        ------
        InputError
            No such scan.
        FileFormatError
            Files that are missing, truncated or do not fit each other.
        """
        if not 0 <= i < len(self):
            raise InputError(f"there is no scan {i}: {self.path} has {len(self)}, counted from 0.")
        path, T = self._files[i], self.T_world_sensor[i]
        rows = _read_words(path, "<f4", 4)
        if not np.isfinite(rows).all():
            raise FileFormatError(path, "has coordinates or remissions that are NaN or infinite.")
        ids = None if labels is None else _read_ids(self.path / labels, path.stem, len(rows))
        return LabelledCloud(
            points=rows[:, :3].astype(np.float64) @ T[:3, :3].T + T[:3, 3],
            classes=SEMANTIC_KITTI,
            labels=None if ids is None else labels_from_semantic_kitti(ids),
            features=rows[:, 3:],
            feature_names=("intensity",),
            T_world_sensor=T,
        )


@dataclass(frozen=True)
class SemanticKITTIReader:
    """The registry's reader of SemanticKITTI sequences."""

    name: str = "semantickitti"
    layout: str = "a SemanticKITTI sequence: a folder with velodyne/*.bin, labels/*.label, poses.txt, calib.txt"

    def matches(self, path: Path) -> bool:
        """Tell whether the path is a folder with a folder `velodyne`."""
        return (path / "velodyne").is_dir()

    def scans(self, path: Path, *, labels: str | Path | None = "labels", world: World = "velodyne") -> Scans:
        """Return the scans of a sequence; see `SemanticKITTISequence` for the options."""
        sequence = SemanticKITTISequence(path, world)
        return Scans(range(len(sequence)), lambda i: sequence.scan(i, labels))


def _read_ids(folder: Path, stem: str, n: int) -> NDArray[np.uint32]:
    """Return the raw class ids of a scan's n points."""
    path = folder / f"{stem}.label"
    ids = _read_words(path, "<u4", 1)[:, 0]
    if len(ids) != n:
        raise FileFormatError(path, f"has {len(ids)} labels for the {n} points of {stem}.bin.")
    return ids


def _read_words(path: Path, dtype: str, width: int) -> NDArray[Any]:
    """Return a headerless binary file of 4-byte words as rows of `width`."""
    try:
        raw = path.read_bytes()
    except FileNotFoundError as error:
        raise FileFormatError(path, "no such file.") from error
    if not raw or len(raw) % (4 * width):
        raise FileFormatError(path, f"is truncated: {len(raw)} bytes are no positive multiple of {4 * width}.")
    return np.frombuffer(bytearray(raw), dtype).reshape(-1, width)


def _read_poses(folder: Path, files: list[Path]) -> NDArray[np.float64]:
    """Return the pose (4, 4) of the camera for each scan file."""
    of_odometry = folder.parent.parent / "poses" / f"{folder.name}.txt"
    path = of_odometry if of_odometry.is_file() and not (folder / "poses.txt").is_file() else folder / "poses.txt"
    lines = _read_lines(path)
    poses = np.empty((len(files), 4, 4))
    for pose, file in zip(poses, files):
        if not (file.stem.isascii() and file.stem.isdecimal()):
            raise FileFormatError(file, "must be named by its number, such as 000000.bin.")
        row = int(file.stem)
        if row >= len(lines):
            raise FileFormatError(path, f"has {len(lines)} rows, but scan {file.name} needs row {row + 1}.")
        pose[:] = _transform(path, lines[row])
    return poses


def _read_calibration(path: Path) -> NDArray[np.float64]:
    """Return Tr (4, 4), which takes the lidar's frame to the camera's."""
    entries = dict(line.partition(":")[::2] for line in _read_lines(path))
    if "Tr" not in entries:
        raise FileFormatError(path, "has no line 'Tr: ...', the transform from velodyne to camera.")
    return _transform(path, entries["Tr"])


def _read_lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="ascii").splitlines()
    except FileNotFoundError as error:
        raise FileFormatError(path, "no such file.") from error
    except UnicodeDecodeError as error:
        raise FileFormatError(path, "is no text file.") from error


def _transform(path: Path, text: str) -> NDArray[np.float64]:
    """Return a rigid transform given by the twelve numbers of its first three rows."""
    try:
        numbers = np.array(text.split(), dtype=np.float64)
        if len(numbers) != 12:
            raise InputError(f"has {len(numbers)} numbers where a transform has 12.")
        return rigid_transform("the transform", np.vstack([numbers.reshape(3, 4), (0, 0, 0, 1)]))
    except ValueError as error:  # InputError is one
        raise FileFormatError(path, f"{error} The line is {text[:60]!r}.") from error
