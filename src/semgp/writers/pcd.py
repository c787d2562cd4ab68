"""Write PCD files of the Point Cloud Library, version 0.7, binary."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import Classes
from semgp.writers.atomic import atomic_write
from semgp.writers.columns import (
    Columns,
    class_comments,
    coordinates,
    number_column,
    probability_columns,
    rgb_column,
    structured,
)

TYPES = {"f": "F", "i": "I", "u": "U"}
"""PCD's TYPE for numpy's kinds."""


def write_pcd(
    path: str | Path,
    points: ArrayLike,
    *,
    classes: Classes | None = None,
    colours: ArrayLike | None = None,
    probability: ArrayLike | None = None,
    **fields: ArrayLike,
) -> None:
    """Write points and what is known about each as a binary PCD file.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists.
    points : (N, 3) array
        Coordinates in metres, written as float32, which PCL's point types need, or as float64 where that would
        lose `LARGEST_ROUNDING`.
    classes : Classes, optional
        Written as comments `semgp class <label> <red> <green> <blue> <name>`, from which `read` takes them again.
    colours : (N, 3) uint8 array, optional
        Written as `rgb`, packed as PCL does it: 0x00RRGGBB in the four bytes of a float.
    probability : (N, C) array, optional
        Class probabilities or weights, written as one field `p_<class name>` a class; needs `classes`.
    **fields : (N,) arrays
        Further fields under their own names, such as `entropy` or `variance`: whole numbers are written as int32,
        all others as float32. `label` is written as uint32, as in PCL's PointXYZL; a missing one is 4294967295.

    Raises
    ------
    InputError
        Arrays of other lengths, probabilities without classes, or whole numbers beyond 32 bits.
    """
    columns = coordinates(points)
    n = len(columns[0][1])
    if colours is not None:
        columns.append(("rgb", _packed(rgb_column(colours, n))))
    if probability is not None:
        columns += probability_columns(probability, classes, n)
    for name, values in fields.items():
        column = number_column(name, values, n)
        columns.append((name, column.astype("<u4") if name == "label" else column))
    header, rows = _header(columns, n, classes), structured(columns, n)
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        file.write(header)
        rows.tofile(file)


def _packed(rgb: NDArray[np.uint8]) -> NDArray[np.generic]:
    red, green, blue = rgb.T.astype("<u4")
    return np.asarray((red << 16 | green << 8 | blue).view("<f4"))


def _header(columns: Columns, n: int, classes: Classes | None) -> bytes:
    types = [column.dtype for _, column in columns]
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        *(f"# {line}" for line in class_comments(classes)),
        "VERSION 0.7",
        "FIELDS " + " ".join(name for name, _ in columns),
        "SIZE " + " ".join(str(t.itemsize) for t in types),
        "TYPE " + " ".join(TYPES[t.kind] for t in types),
        "COUNT " + " ".join("1" for _ in types),
        f"WIDTH {n}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {n}",
        "DATA binary",
    ]
    return "\n".join([*lines, ""]).encode()
