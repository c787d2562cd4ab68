"""KITTI's binary files of lidar scans, `.bin`, and of their labels, `.label`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.conventions import SEMANTIC_KITTI_FILES
from semgp.errors import FileFormatError


def read_kitti_bin(path: str | Path, *, classes: Classes = SEMANTIC_KITTI_FILES) -> LabelledCloud:
    """Read one scan by itself, in the lidar's own frame, with the remission as feature "intensity".

    Labels are those of the file of the same name with the ending `.label`, beside it or in `../labels`; without
    one, the scan has none.

    Parameters
    ----------
    path : str or Path
        The `.bin` file: float32 x, y, z, remission.
    classes : Classes, optional
        What the raw ids mean; left out, SemanticKITTI's training classes.

    Raises
    ------
    FileFormatError
        Files that are missing, truncated or do not fit each other.
    """
    path = Path(path)
    beside = (path.with_suffix(".label"), path.parent.parent / "labels" / f"{path.stem}.label")
    return scan_of(path, next((label for label in beside if label.is_file()), None), classes, np.eye(4))


def scan_of(
    path: Path,
    label_path: Path | None,
    classes: Classes,
    T_world_sensor: NDArray[np.float64],
    stamp: float | None = None,
) -> LabelledCloud:
    """Return a scan in the world frame, with the labels of a file or none.

    Raises
    ------
    FileFormatError
        Files that are missing, truncated or do not fit each other.
    """
    T = T_world_sensor
    rows = _read_words(path, "<f4", 4)
    if not np.isfinite(rows).all():
        raise FileFormatError(path, "has coordinates or remissions that are NaN or infinite.")
    return LabelledCloud(
        points=rows[:, :3].astype(np.float64) @ T[:3, :3].T + T[:3, 3],
        classes=classes,
        labels=None if label_path is None else _read_labels(label_path, classes, path, len(rows)),
        features=rows[:, 3:],
        feature_names=("intensity",),
        T_world_sensor=T,
        stamp=stamp,
    )


def _read_labels(path: Path, classes: Classes, scan: Path, n: int) -> NDArray[np.int32]:
    """Return the labels of a scan's n points; the upper 16 bits of an id are the instance, which is ignored."""
    ids = _read_words(path, "<u4", 1)[:, 0]
    if len(ids) != n:
        raise FileFormatError(path, f"has {len(ids)} labels for the {n} points of {scan}.")
    labels = classes.from_ids(ids & 0xFFFF)
    if labels.max() >= len(classes):
        raise FileFormatError(path, f"has labels up to {labels.max()}, but there are {len(classes)} classes.")
    return labels.astype(np.int32)


def _read_words(path: Path, dtype: str, width: int) -> NDArray[Any]:
    """Return a headerless binary file of 4-byte words as rows of `width`."""
    try:
        raw = path.read_bytes()
    except FileNotFoundError as error:
        raise FileFormatError(path, "no such file.") from error
    if not raw or len(raw) % (4 * width):
        raise FileFormatError(path, f"is truncated: {len(raw)} bytes are no positive multiple of {4 * width}.")
    return np.frombuffer(bytearray(raw), dtype).reshape(-1, width)
