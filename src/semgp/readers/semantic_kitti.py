"""SemanticKITTI (Behley et al., 2019): lidar scans with poses, true labels and a network's predictions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.conventions import SEMANTIC_KITTI_FILES
from semgp.errors import FileFormatError, InputError
from semgp.readers.kitti import scan_of
from semgp.readers.protocol import Scans
from semgp.readers.trajectory import numbers_of, read_kitti_poses, text_lines_of, transform_of

World = Literal["velodyne", "camera"]


class SemanticKITTISequence:
    """One sequence: `velodyne/*.bin`, `calib.txt`, `poses.txt`, and folders of labels such as `labels/*.label`.

    As the data set ships it, this is a folder `sequences/NN`; where that has no `poses.txt`, the poses of the
    KITTI odometry benchmark, `../../poses/NN.txt`, are taken. The number that names a scan's file is the row
    of its pose, so a sequence may hold any part of the scans; and of its time, where there is a `times.txt`.

    Parameters
    ----------
    path : str or Path
        The folder.
    world : "velodyne" or "camera"
        The world frame. Row i of the poses is P_i, the camera at scan i in the camera's frame at scan 0
        (z forward); Tr of the calibration takes the lidar's frame to the camera's. "camera" gives
        T_world_sensor = P_i Tr. "velodyne" gives Tr^-1 P_i Tr: the world is the lidar's frame at scan 0,
        x forward and z up, as ROS REP-103 demands.
    poses : str or Path, optional
        A file of KITTI poses, of the camera, instead of the sequence's.

    Raises
    ------
    InputError
        Another world.
    FileFormatError
        Files that are missing or damaged, or fewer poses than scans.
    """

    def __init__(self, path: str | Path, world: World = "velodyne", poses: str | Path | None = None) -> None:
        if world not in ("velodyne", "camera"):
            raise InputError(f"the world frame is 'velodyne' or 'camera', not {world!r}.")
        self.path = Path(path)
        self._files = sorted((self.path / "velodyne").glob("*.bin"))
        if not self._files:
            raise FileFormatError(self.path, "is no SemanticKITTI sequence: it has no velodyne/*.bin.")
        Tr = _read_calibration(self.path / "calib.txt")
        P = _read_poses(_pose_file(self.path) if poses is None else Path(poses), self._files)
        self._stamps = _read_stamps(self.path / "times.txt", self._files)
        self.T_world_sensor = (np.linalg.inv(Tr) if world == "velodyne" else np.eye(4)) @ P @ Tr

    def __len__(self) -> int:
        return len(self._files)

    def scan(
        self, i: int, labels: str | Path | None = "labels", classes: Classes = SEMANTIC_KITTI_FILES
    ) -> LabelledCloud:
        """Read scan i, in the world frame, with the remission as feature "intensity".

        Parameters
        ----------
        i : int
            Position among the sequence's scans, from 0.
        labels : str or Path, optional
            Folder of the label files, within the sequence or elsewhere: "labels" is the truth, "predictions"
            what a network said. None reads no labels.
        classes : Classes, optional
            What the raw ids mean; left out, the training classes.

        Raises
        ------
        InputError
            No such scan.
        FileFormatError
            Files that are missing, truncated or do not fit each other.
        """
        if not 0 <= i < len(self):
            raise InputError(f"there is no scan {i}: {self.path} has {len(self)}, counted from 0.")
        path = self._files[i]
        label_path = None if labels is None else self._folder(labels) / f"{path.stem}.label"
        return scan_of(path, label_path, classes, self.T_world_sensor[i], self._stamps[i])

    def _folder(self, labels: str | Path) -> Path:
        """Return a folder of label files: within the sequence or, where it has none of the name, elsewhere."""
        within = self.path / labels
        return within if within.is_dir() or not Path(labels).is_dir() else Path(labels)


@dataclass(frozen=True)
class SemanticKITTIReader:
    """The registry's reader of SemanticKITTI sequences."""

    name: str = "semantickitti"
    layout: str = "a SemanticKITTI sequence: a folder with velodyne/*.bin, labels/*.label, poses.txt, calib.txt"

    def matches(self, path: Path) -> bool:
        """Tell whether the path is a folder with a folder `velodyne`."""
        return (path / "velodyne").is_dir()

    def scans(
        self,
        path: Path,
        *,
        labels: str | Path | None = None,
        classes: Classes = SEMANTIC_KITTI_FILES,
        poses: str | Path | None = None,
        world: World = "velodyne",
    ) -> Scans:
        """Return the scans of a sequence; see `SemanticKITTISequence` for the options.

        Without `labels`, those in the folder "labels" are read, or none where the sequence has no such folder.
        """
        sequence = SemanticKITTISequence(path, world, poses)
        if labels is None and (path / "labels").is_dir():
            labels = "labels"
        return Scans(range(len(sequence)), lambda i: sequence.scan(i, labels, classes))


def _rows_of(path: Path, files: list[Path], count: int) -> list[int]:
    """Return the rows that the scan files have in a file of so many."""
    for file in files:
        if not (file.stem.isascii() and file.stem.isdecimal()):
            raise FileFormatError(file, "must be named by its number, such as 000000.bin.")
        if int(file.stem) >= count:
            raise FileFormatError(path, f"has {count} rows, but scan {file.name} needs row {int(file.stem) + 1}.")
    return [int(file.stem) for file in files]


def _pose_file(folder: Path) -> Path:
    """Return the sequence's own poses or, where it has none, those of the odometry benchmark."""
    own, of_odometry = folder / "poses.txt", folder.parent.parent / "poses" / f"{folder.name}.txt"
    return of_odometry if of_odometry.is_file() and not own.is_file() else own


def _read_poses(path: Path, files: list[Path]) -> NDArray[np.float64]:
    """Return the pose (4, 4) of the camera for each scan file."""
    poses = read_kitti_poses(path)
    return poses[_rows_of(path, files, len(poses))]


def _read_calibration(path: Path) -> NDArray[np.float64]:
    """Return Tr (4, 4), which takes the lidar's frame to the camera's."""
    for n, line in enumerate(text_lines_of(path), start=1):
        key, _, numbers = line.partition(":")
        if key == "Tr":
            return transform_of(path, n, numbers_of(path, n, numbers.split()))
    raise FileFormatError(path, "has no line 'Tr: ...', the transform from velodyne to camera.")


def _read_stamps(path: Path, files: list[Path]) -> list[float | None]:
    """Return the time of each scan, None where the sequence does not tell."""
    if not path.is_file():
        return [None] * len(files)
    lines = text_lines_of(path)
    return [
        numbers_of(path, row + 1, lines[row].split()[:1] or [""])[0] for row in _rows_of(path, files, len(lines))
    ]
