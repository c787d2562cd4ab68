"""Write LAS 1.4 files, compressed (LAZ) where the name says so."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.asprs import CLASS_RECORD, UNCLASSIFIED, codes_of, laspy_for
from semgp.checks import checked_labels
from semgp.classes import Classes
from semgp.errors import InputError
from semgp.writers.atomic import atomic_write
from semgp.writers.columns import (
    Columns,
    class_comments,
    coordinates,
    number_column,
    probability_columns,
    require_different,
    rgb_column,
)

FINEST_SCALE = 1e-4
"""Coordinates are whole multiples of this many metres, or coarser ones where a cloud spans more than 400 km."""

LONGEST_NAME, LONGEST_RECORD = 32, 65_535
"""Bytes of the name of an extra field, and of a record before the points."""

TAKEN = frozenset(("x", "y", "z", "X", "Y", "Z", "red", "green", "blue", "classification"))


def write_las(
    path: str | Path,
    points: ArrayLike,
    *,
    classes: Classes | None = None,
    colours: ArrayLike | None = None,
    probability: ArrayLike | None = None,
    label: ArrayLike | None = None,
    **fields: ArrayLike,
) -> None:
    """Write points and what is known about each as a LAS 1.4 file of point format 7.

    Labels become `classification`. Where all classes bear names of the ASPRS (`semgp.asprs.ASPRS_CODES`), each has
    its code there: "building" is 6. Else class c has the code 64 + c, the first that the ASPRS leaves to the user.
    A missing label is 1, unclassified. The names stand in the file's classification lookup, cut to 15 letters, and
    in full in a record of semgp's, from which `read` takes classes, colours and labels again.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists; compressed if it is called `*.laz`.
    points : (N, 3) array
        Coordinates in metres, written as multiples of 0.1 mm from their middle.
    classes : Classes, optional
        The classes of the labels; left out, they are numbered.
    colours : (N, 3) uint8 array, optional
        Written with 16 bits, 255 as 65535.
    probability : (N, C) array, optional
        Class probabilities or weights, written as one extra field `p_<class name>` a class; `prob_<number>` where
        a name is longer than 32 bytes. Needs `classes`.
    label : (N,) integer array, optional
        Labels, 0 to C - 1, or -1 where missing.
    **fields : (N,) arrays
        Fields of LAS itself under its names, such as `intensity` or `gps_time`; all others become extra fields,
        such as `entropy` or `variance`, whole numbers as int32, all others as float32.

    Raises
    ------
    MissingExtraError
        Without the extra `las`.
    InputError
        Arrays of other lengths, numbers that a field cannot hold, more than 192 classes, or two fields of one
        name.
    """
    laspy = laspy_for("writing LAS files")
    n = len(coordinates(points)[0][1])
    X = np.asarray(points, dtype=np.float64)
    header = laspy.LasHeader(version="1.4", point_format=7)
    if taken := sorted(fields.keys() & TAKEN):
        raise InputError(f"{', '.join(taken)} of a LAS file are written from the points, colours and labels.")
    own = {name: np.asarray(fields.pop(name)) for name in header.point_format.dimension_names if name in fields}
    extra = _probabilities(probability, classes, n) if probability is not None else []
    extra += [(name, number_column(name, values, n)) for name, values in fields.items()]
    require_different(extra)
    if long := [name for name, _ in extra if len(name.encode()) > LONGEST_NAME]:
        raise InputError(f"{', '.join(long)}: the name of a LAS field has {LONGEST_NAME} bytes at most.")
    header.add_extra_dims([laspy.ExtraBytesParams(name, column.dtype) for name, column in extra])
    header.scales, header.offsets = _grid(X)
    las = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(n, header=header))
    las.x, las.y, las.z = X.T
    las.classification = np.full(n, UNCLASSIFIED, dtype=np.uint8)
    if label is not None:
        classes = classes or Classes.numbered(int(np.max(label, initial=0)) + 1)
        labels = checked_labels(label, n, len(classes))
        las.classification = np.array([*codes_of(classes), UNCLASSIFIED], dtype=np.uint8)[labels]
    if colours is not None:
        las.red, las.green, las.blue = 257 * rgb_column(colours, n).T.astype(np.uint16)
    for name, column in extra:
        las[name] = column
    for name, values in own.items():
        _set(las, name, values, n)
    if classes is not None:
        header.vlrs += _records(laspy, classes)
    with atomic_write(path) as temporary:
        las.write(temporary)


def _probabilities(probability: ArrayLike, classes: Classes | None, n: int) -> Columns:
    columns = probability_columns(probability, classes, n)
    if all(len(name.encode()) <= LONGEST_NAME for name, _ in columns):
        return columns
    return [(f"prob_{c}", column) for c, (_, column) in enumerate(columns)]


def _grid(X: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the scales and offsets with which the coordinates fit into 32 bits."""
    if not len(X):
        return np.full(3, FINEST_SCALE), np.zeros(3)
    low, high = X.min(axis=0), X.max(axis=0)
    middle = np.round(low / 2 + high / 2)
    reach = max(float(np.max(high - middle)), float(np.max(middle - low)))
    coarser = max(0, math.ceil(math.log10(max(reach, 1.0) / FINEST_SCALE / (2**31 - 1))))
    return np.full(3, FINEST_SCALE * 10.0**coarser), middle


def _set(las: Any, name: str, values: NDArray[Any], n: int) -> None:
    """Fill in a field of LAS itself."""
    column = number_column(name, values, n) if values.dtype.kind != "f" else values
    try:
        las[name] = column
    except (OverflowError, ValueError) as error:
        raise InputError(f"{name} cannot be written to a LAS file: {error}.") from error
    if not np.array_equal(las[name], column):
        raise InputError(f"{name} does not fit LAS' field of that name, which would change its values.")


def _records(laspy: Any, classes: Classes) -> list[Any]:
    """Return the records that name the classes, for others and for semgp."""
    lookup = laspy.vlrs.known.ClassificationLookupVlr()
    for code, name in zip(codes_of(classes), classes.names):
        lookup[code] = name.encode("ascii", "replace").decode()[:15]
    text = "\n".join(class_comments(classes)).encode()
    if len(text) > LONGEST_RECORD:
        raise InputError("the names of the classes are too long for a LAS file.")
    return [lookup, laspy.VLR(*CLASS_RECORD, "classes and their colours", text)]
