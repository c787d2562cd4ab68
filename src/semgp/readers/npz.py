"""semgp's own npz point files: every part of a labelled cloud, as plain arrays.

The arrays of a file; all but `points` may be left out:

================= =============== ===================================================
`points`          (N, 3) float    metres, world frame
`labels`          (N,) integer    hard labels, -1 where missing
`weights`         (N, C) float    soft labels instead
`names`           (C,) text       class names; left out, the classes are numbered
`palette`         (C, 3) uint8    class colours
`colours`         (N, 3) uint8    red, green, blue of the points
`features`        (N, F) float    further inputs
`feature_names`   (F,) text       their names
`T_world_sensor`  (4, 4) float    pose of the sensor
`confidence`      (N,) float      how much each label counts, 0 to 1
`covariances`     (N, 3, 3) float of each position, m^2
`pose_covariance` (6, 6) float    of the pose
`stamp`           () float        when the cloud was taken, seconds
`pixels`          (N, 2) integer  row and column in the image
`image_shape`     (2,) integer    rows and columns of the image
`up`              () text         axis of the world that points upwards: `z`, `-y`
================= =============== ===================================================

Other arrays are ignored. Nothing in a file is ever unpickled. `semgp.writers.write_npz` writes the layout.
"""

from __future__ import annotations

import io
import lzma
import math
import struct
import threading
import tokenize
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.readers.fields import numbered_classes
from semgp.upward import Up

KINDS = {
    **{"points": "fiu", "labels": "iu", "weights": "fiu", "names": "U", "palette": "u", "colours": "u"},
    **{"confidence": "fiu", "covariances": "fiu", "pose_covariance": "fiu", "stamp": "fiu"},
    **{"features": "fiu", "feature_names": "U", "T_world_sensor": "fiu", "pixels": "iu", "image_shape": "iu"},
    "up": "U",
}
"""Kinds of numpy type that each array of the layout may have."""

_PARSING = threading.Lock()  # Python 3.11's own parser, which reads headers, fails at times in several threads

LARGEST_UNPACKED = 1 << 30
"""Bytes up to which any file is unpacked, however small it is."""

DAMAGE = (
    *(OSError, EOFError, ValueError, KeyError, TypeError, OverflowError, RuntimeError, SyntaxError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, tokenize.TokenError),
)
"""What zipfile and numpy raise on damaged or hostile files."""


def read_npz(path: str | Path, *, classes: Classes | None = None) -> LabelledCloud:
    """Read a cloud from an npz file of the layout above.

    Parameters
    ----------
    path : str or Path
        The file.
    classes : Classes, optional
        Classes of the labels, instead of those that the file names.

    Raises
    ------
    FileFormatError
        A file that is no npz file, is damaged or truncated, or whose arrays make no cloud.
    """
    path = Path(path)
    arrays = read_arrays(path, KINDS)
    if "points" not in arrays:
        raise FileFormatError(path, "has no array 'points': see semgp.readers.npz for the layout.")
    for name, array in arrays.items():
        if array.dtype.kind not in KINDS[name]:
            raise FileFormatError(path, f"has {name} of the wrong type {array.dtype}.")
    try:
        if classes is not None and "labels" in arrays:
            arrays["labels"] = classes.from_ids(arrays["labels"])
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite the cloud refuses
            return _cloud(arrays, classes or _classes(path, arrays))
    except InputError as error:
        raise FileFormatError(path, str(error)) from error


def read_arrays(path: Path, names: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
    """Return the arrays that an npz file holds, or those of the names given, without ever unpickling.

    Raises
    ------
    FileFormatError
        A file that is missing, no npz file, damaged or truncated.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            stored = [member.removesuffix(".npy") for member in archive.namelist()]
            wanted = stored if names is None else [name for name in names if name in stored]
            _refuse_bombs(path, archive)
            return {name: read_npy(read_member(archive, archive.getinfo(f"{name}.npy"))) for name in wanted}
    except FileNotFoundError as error:
        raise FileFormatError(path, "no such file.") from error
    except DAMAGE as error:
        raise FileFormatError(path, f"is no npz file, or is damaged: {error}") from error


def _refuse_bombs(path: Path, archive: zipfile.ZipFile) -> None:
    """Raise FileFormatError for an archive that swells a thousandfold and to more than a scan ever takes."""
    unpacked = sum(member.file_size for member in archive.infolist())
    if unpacked > LARGEST_UNPACKED and unpacked > 1000 * path.stat().st_size:
        raise FileFormatError(path, f"would unpack to {unpacked:,} bytes: refused as a decompression bomb.")


def read_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    """Return what a member of an archive holds, never unpacking more than its entry says.

    Raises
    ------
    ValueError
        Bytes of another number, or packed in a way that cannot be bounded.
    """
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{member.filename} is neither stored nor deflated.")
    with archive.open(member) as file:
        raw = file.read(member.file_size)
        if len(raw) != member.file_size or file.read(1):
            raise ValueError(f"{member.filename} has not the {member.file_size:,} bytes that its entry says.")
    return raw


def read_npy(raw: bytes) -> NDArray[Any]:
    """Return the array in a .npy file; unlike numpy, believe no header that does not fit the bytes behind it."""
    stream = io.BytesIO(raw)
    version = npy.read_magic(stream)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    with _PARSING:
        shape, fortran_order, dtype = read_header(stream)
    body = raw[stream.tell() :]
    if dtype.hasobject:
        raise ValueError("it holds Python objects, which are never read.")
    if math.prod(shape) * dtype.itemsize != len(body):
        raise ValueError(f"an array of shape {shape} and type {dtype} has {len(body)} bytes.")
    return np.frombuffer(bytearray(body), dtype).reshape(shape, order="F" if fortran_order else "C")


def _classes(path: Path, arrays: dict[str, NDArray[Any]]) -> Classes:
    """Return the classes that a file names, or as many numbered ones as its labels need."""
    if "names" in arrays:
        names, palette = arrays["names"], arrays.get("palette", np.empty((0, 3), np.uint8))
        if names.ndim != 1 or palette.ndim != 2:
            raise FileFormatError(path, f"has names of shape {names.shape} and a palette of {palette.shape}.")
        return Classes(tuple(names.tolist()), tuple(palette.tolist()))
    weights = arrays.get("weights")
    if weights is not None and weights.ndim == 2:
        return Classes.numbered(weights.shape[1])
    return numbered_classes(path, arrays.get("labels"))


def _cloud(arrays: dict[str, NDArray[Any]], classes: Classes) -> LabelledCloud:
    image_shape = arrays["image_shape"].tolist() if "image_shape" in arrays else None
    if image_shape is not None and np.shape(image_shape) != (2,):
        raise InputError("image_shape must be two numbers, rows and columns.")
    if (stamp := arrays.get("stamp")) is not None and stamp.shape != ():
        raise InputError("stamp must be one number, the time in seconds.")
    if (up := arrays.get("up", np.array("z"))).shape != ():
        raise InputError("up must be one axis, such as z or -y.")
    return LabelledCloud(
        points=arrays["points"],
        classes=classes,
        labels=arrays.get("labels"),
        weights=arrays.get("weights"),
        colours=arrays.get("colours"),
        features=arrays.get("features"),
        feature_names=tuple(np.ravel(arrays.get("feature_names", ())).tolist()),
        T_world_sensor=arrays.get("T_world_sensor"),
        confidence=arrays.get("confidence"),
        covariances=arrays.get("covariances"),
        pose_covariance=arrays.get("pose_covariance"),
        stamp=None if stamp is None else float(stamp),
        pixels=arrays.get("pixels"),
        image_shape=None if image_shape is None else (image_shape[0], image_shape[1]),
        up=cast("Up", up.item()),
    )
