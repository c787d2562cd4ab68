"""Write PLY point files, for viewers such as CloudCompare."""

from __future__ import annotations

from pathlib import Path

from numpy.typing import ArrayLike

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


def write_ply(
    path: str | Path,
    points: ArrayLike,
    *,
    classes: Classes | None = None,
    colours: ArrayLike | None = None,
    probability: ArrayLike | None = None,
    **fields: ArrayLike,
) -> None:
    """Write points and what is known about each as a binary little-endian PLY file.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists.
    points : (N, 3) array
        Coordinates in metres, written as float32, or as float64 where that would lose `LARGEST_ROUNDING`.
    classes : Classes, optional
        Written as comments `semgp class <label> <red> <green> <blue> <name>`, from which `read` takes them again.
    colours : (N, 3) uint8 array, optional
        Written as `red`, `green`, `blue`.
    probability : (N, C) array, optional
        Class probabilities or weights, written as one property `p_<class name>` a class; needs `classes`.
    **fields : (N,) arrays
        Further properties under their own names, such as `label`, `confidence`, `entropy` or `variance`:
        whole numbers are written as int32, all others as float32.

    Raises
    ------
    InputError
        Arrays of other lengths, probabilities without classes, or whole numbers beyond 32 bits.
    """
    columns = coordinates(points)
    n = len(columns[0][1])
    if colours is not None:
        columns += zip(("red", "green", "blue"), rgb_column(colours, n).T)
    if probability is not None:
        columns += probability_columns(probability, classes, n)
    columns += [(name, number_column(name, values, n)) for name, values in fields.items()]
    header, rows = ply_header(columns, n, classes), structured(columns, n)
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        file.write(header)
        rows.tofile(file)


def ply_header(columns: Columns, n: int, classes: Classes | None, *further: str) -> bytes:
    """Return the header of a binary PLY file of n vertices, with further lines before its end.

    Raises
    ------
    InputError
        A class name that a line of text cannot hold.
    """
    types = {"f4": "float", "f8": "double", "u1": "uchar", "i4": "int"}
    lines = ["ply", "format binary_little_endian 1.0", "comment written by semgp"]
    lines += [f"comment {line}" for line in class_comments(classes)]
    lines.append(f"element vertex {n}")
    lines += [f"property {types[column.dtype.str[1:]]} {name}" for name, column in columns]
    return "\n".join([*lines, *further, "end_header", ""]).encode()
