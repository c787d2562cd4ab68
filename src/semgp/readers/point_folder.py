"""A folder of point files, one a scan, with the poses of a trajectory if it has one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.readers.protocol import FileReader, Scans, options_of
from semgp.readers.trajectory import Trajectory, read_trajectory

PLAIN_TEXT = (".asc", ".csv", ".txt", ".xyz")
"""Among point files of another format, files with these endings are something else, such as the poses."""

IMAGES = (".png", ".jpg", ".jpeg")

OLDEST_STAMP, NANOSECONDS = 1e8, 1e16
"""Whole numbers that name files count them below the first, are nanoseconds above the second, else seconds."""


@dataclass(frozen=True)
class PointFolderReader:
    """The registry's reader of folders of point files.

    Parameters
    ----------
    formats : sequence of FileReader
        The formats of point files.
    """

    formats: Sequence[FileReader]
    name: str = "point-folder"
    layout: str = "a folder of point files of one format, one a scan"

    def matches(self, path: Path) -> bool:
        """Tell whether the path is a folder with point files but no images, or of text files of points alone."""
        files = list(path.iterdir()) if path.is_dir() else []
        found = [file for file in files if any(reader.matches(file) for reader in self.formats)]
        if all(file.suffix.lower() in PLAIN_TEXT for file in found):
            return bool(found) and len(found) == len(files)
        return not any(file.suffix.lower() in IMAGES for file in files)

    def scans(
        self,
        path: Path,
        *,
        classes: Classes | None = None,
        field: str | None = None,
        features: Sequence[str] | None = None,
        poses: str | Path | None = None,
    ) -> Scans:
        """Return the clouds of a folder's point files, in the natural order of their names: 9 before 10.

        Parameters
        ----------
        path : Path
            The folder.
        classes, field, features : optional
            Options of the files' format, where it has them.
        poses : str or Path, optional
            A trajectory of the sensor in whose frame the points are: see `read_trajectory`. Where it has stamps
            and the files are named by theirs, such as 1311868164.363181.pcd or, in nanoseconds,
            1311868164363181000.pcd, the pose at the stamp is taken; otherwise there must be as many poses as
            files, in their order. Left out, the points are in the world frame.

        Raises
        ------
        InputError
            An option that the format does not have.
        FileFormatError
            Files of several formats, or a trajectory that does not fit the files.
        """
        reader, files = self._files(path, None if poses is None else Path(poses).resolve())
        wanted: dict[str, Any] = {"classes": classes, "field": field, "features": features}
        options = {name: value for name, value in wanted.items() if value is not None}
        if unknown := [name for name in options if name not in options_of(reader)]:
            raise InputError(f"{path}: the format {reader.name} of its files has no option {unknown[0]!r}.")
        if poses is None and len(files) > 1 and path.name == "velodyne" and (path.parent / "poses.txt").is_file():
            raise InputError(
                f"{path} holds scans in the lidar's own frame, and their poses lie beside it: give the folder "
                f"{path.parent}, or --poses FILE with poses of the lidar."
            )
        if poses is None:
            return Scans(range(len(files)), lambda i: reader.read(files[i], **options))
        T, stamps = _poses_of(Path(poses), read_trajectory(poses), files)
        return Scans(range(len(files)), lambda i: placed(reader.read(files[i], **options), T[i], stamps[i]))

    def _files(self, path: Path, poses: Path | None) -> tuple[FileReader, list[Path]]:
        """Return the one format of a folder's point files, and the files."""
        held = [file for file in path.iterdir() if file.resolve() != poses]
        found = {reader: [file for file in held if reader.matches(file)] for reader in self.formats}
        found = {reader: files for reader, files in found.items() if files}
        if any(reader.extension not in PLAIN_TEXT for reader in found):
            found = {reader: files for reader, files in found.items() if reader.extension not in PLAIN_TEXT}
        if len(found) != 1:
            kinds = ", ".join(f"{len(files)} {reader.extension}" for reader, files in found.items()) or "none"
            raise FileFormatError(path, f"must hold point files of one format, but has {kinds}.")
        [(reader, files)] = found.items()
        return reader, sorted(files, key=natural)


def natural(path: Path) -> list[tuple[int, int, str]]:
    """Return what sorts files by the numbers in their names."""
    parts = filter(None, re.split(r"(\d+)", path.name))
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts]


def placed(cloud: LabelledCloud, T: NDArray[np.float64], stamp: float | None) -> LabelledCloud:
    """Return a cloud in the sensor's frame in the world, where T (4, 4) is the pose of that frame."""
    return replace(
        cloud,
        points=cloud.points @ T[:3, :3].T + T[:3, 3],
        T_world_sensor=T if cloud.T_world_sensor is None else T @ cloud.T_world_sensor,
        stamp=cloud.stamp if stamp is None else stamp,
    )


def _poses_of(
    path: Path, trajectory: Trajectory, files: Sequence[Path]
) -> tuple[NDArray[np.float64], Sequence[float | None]]:
    """Return the pose and the stamp of each file."""
    stamps = [stamp for file in files if (stamp := _stamp(file)) is not None]
    if trajectory.stamps is not None and len(stamps) == len(files):
        try:
            return np.stack([trajectory.at(stamp) for stamp in stamps]), stamps
        except InputError as error:
            raise FileFormatError(path, str(error)) from error
    if len(trajectory) != len(files):
        raise FileFormatError(
            path,
            f"has {len(trajectory)} poses for {len(files)} point files, whose names are no stamps.",
        )
    return trajectory.T_world_sensor, [None] * len(
        files
    ) if trajectory.stamps is None else trajectory.stamps.tolist()


def _stamp(file: Path) -> float | None:
    """Return the stamp in seconds that names a file, None where none does."""
    if not re.fullmatch(r"\d{1,20}(\.\d{1,20})?", file.stem, re.ASCII):
        return None
    number = float(file.stem)
    if "." not in file.stem and number < OLDEST_STAMP:
        return None
    return number * 1e-9 if number > NANOSECONDS else number
