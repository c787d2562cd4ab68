"""RGB-D recordings as TUM's benchmark has them (Sturm et al., 2012): lists of images and poses by their stamps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.camera import Pinhole
from semgp.errors import FileFormatError
from semgp.readers.recording import Frame, Recording
from semgp.readers.rgbd_text import Pose, camera_file
from semgp.readers.trajectory import Trajectory, read_tum, text_lines_of

TUM_CAMERA = Pinhole(fx=525.0, fy=525.0, cx=319.5, cy=239.5)
"""The intrinsics that the benchmark recommends for its images of 640 x 480, which come registered."""

TUM_UNITS = 5000.0
"""Units a metre of the benchmark's depth images."""

LARGEST_GAP = 0.02
"""Seconds that the stamps of a colour image, its depth image and its pose may lie apart, as in its tools."""


def tum(path: Path) -> Recording:
    """Return a recording of `rgb.txt`, `depth.txt` (stamp and file) and `groundtruth.txt` (stamp, position, xyzw).

    Each colour image goes with the depth image nearest in time and the pose at its time, between its neighbours.
    Those without a depth image within `LARGEST_GAP` are no frames, those without a pose are frames without one.
    Intrinsics are `TUM_CAMERA`, unless the folder has a `camera-intrinsics.txt`, a 3 x 3 matrix in text.
    """
    colour_stamps, colours = _file_list(path / "rgb.txt")
    depth_stamps, depths = _file_list(path / "depth.txt")
    trajectory = read_tum(path / "groundtruth.txt")
    frames = []
    for stamp, colour in zip(colour_stamps.tolist(), colours):
        depth = _nearest(depth_stamps, stamp)
        if depth is not None:
            frames.append(Frame(path / colour, path / depths[depth], _pose_at(trajectory, stamp), stamp))
    intrinsics = path / "camera-intrinsics.txt"
    camera = camera_file(intrinsics) if intrinsics.is_file() else TUM_CAMERA
    return Recording(tuple(frames), camera, units_per_metre=TUM_UNITS)


def _nearest(stamps: NDArray[np.float64], stamp: float) -> int | None:
    """Return the position of the nearest of ascending stamps, None where it is more than `LARGEST_GAP` away."""
    after = int(np.searchsorted(stamps, stamp))
    around = range(max(after - 1, 0), min(after + 1, len(stamps)))
    best = min(around, key=lambda i: abs(stamps[i] - stamp), default=None)
    return None if best is None or abs(stamps[best] - stamp) > LARGEST_GAP else best


def _file_list(path: Path) -> tuple[NDArray[np.float64], list[str]]:
    """Return the stamps, ascending, and files that a list names; none outside the recording's folder."""
    rows = [line.split() for line in text_lines_of(path) if line.strip() and not line.startswith("#")]
    if not rows or any(len(row) != 2 for row in rows):
        raise FileFormatError(path, "must have lines of a stamp and a file, apart from comments.")
    stamps = _stamps(path, [stamp for stamp, _ in rows])
    for _, name in rows:
        if Path(name).is_absolute() or ".." in Path(name).parts:
            raise FileFormatError(path, f"names a file outside its folder: {name[:80]!r}.")
    return stamps, [name for _, name in rows]


def _pose_at(trajectory: Trajectory, stamp: float) -> Pose:
    """Return the pose at a time, between its neighbours; None where none is within `LARGEST_GAP`."""
    assert trajectory.stamps is not None
    if _nearest(trajectory.stamps, stamp) is None:
        return None
    return trajectory.at(float(np.clip(stamp, trajectory.stamps[0], trajectory.stamps[-1])))


def _stamps(path: Path, words: list[str]) -> NDArray[np.float64]:
    try:
        stamps = np.array(words, dtype=np.float64)
    except ValueError as error:
        raise FileFormatError(path, f"has stamps that are no numbers: {error}.") from error
    if not np.isfinite(stamps).all() or (np.diff(stamps) < 0).any():
        raise FileFormatError(path, "has stamps that do not ascend.")
    return stamps
