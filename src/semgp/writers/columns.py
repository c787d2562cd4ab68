"""The columns of a point file, checked and named."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import Classes
from semgp.errors import InputError

Columns = list[tuple[str, NDArray[np.generic]]]

LARGEST_ROUNDING = 1e-4
"""Coordinates that float32 would move by more than this many metres are written as float64."""


def coordinates(points: ArrayLike) -> Columns:
    """Return the columns x, y and z: float32, or float64 where that would lose `LARGEST_ROUNDING`.

    Raises
    ------
    InputError
        Points that are not (N, 3) and finite.
    """
    X = np.asarray(points, dtype=np.float64)
    if X.ndim != 2 or X.shape[1] != 3:
        raise InputError(f"points must have shape (N, 3), not {X.shape}.")
    if not np.isfinite(X).all():
        raise InputError("points must be finite: drop those that are NaN or infinite.")
    with np.errstate(over="ignore"):  # beyond float32 the rounding is infinite
        rounded = X.astype("<f4")
    exact = np.abs(rounded - X).max(initial=0) > LARGEST_ROUNDING
    return list(zip("xyz", (X.astype("<f8") if exact else rounded).T))


def rgb_column(colours: ArrayLike, n: int) -> NDArray[np.uint8]:
    """Return red, green and blue (n, 3).

    Raises
    ------
    InputError
        Another shape, or another type than uint8.
    """
    rgb = _column("colours", colours, (n, 3))
    if rgb.dtype != np.uint8:
        raise InputError(f"colours must be uint8, not {rgb.dtype}.")
    return rgb.astype(np.uint8, copy=False)


def probability_columns(probability: ArrayLike, classes: Classes | None, n: int) -> Columns:
    """Return a column `p_<class name>` a class, float32, blanks in the names as `_`.

    Raises
    ------
    InputError
        Another shape than (n, C), or no classes.
    """
    if classes is None:
        raise InputError("probability needs classes, which name its columns.")
    p = _column("probability", probability, (n, len(classes))).astype("<f4")
    return list(zip(("p_" + re.sub(r"\s", "_", name) for name in classes.names), p.T))


def number_column(name: str, values: ArrayLike, n: int) -> NDArray[np.generic]:
    """Return a field's values as int32 or float32.

    Raises
    ------
    InputError
        A name that no header can hold, another shape, no numbers, or whole numbers beyond 32 bits.
    """
    if not re.fullmatch(r"[!-~]+", name):
        raise InputError(f"{name!r} cannot name a field of a point file: use ASCII letters, digits and _.")
    column = _column(name, values, (n,))
    if column.dtype.kind == "f":
        return column.astype("<f4")
    if column.dtype.kind not in "iub":
        raise InputError(f"{name} must be numbers, not {column.dtype}.")
    if n and (column.max() > 2**31 - 1 or column.min() < -(2**31)):
        raise InputError(f"{name} goes from {column.min()} to {column.max()}: a field has 32 bits.")
    return column.astype("<i4")


def structured(columns: Columns, n: int) -> NDArray[np.void]:
    """Return the columns as one structured array.

    Raises
    ------
    InputError
        Two columns of one name.
    """
    require_different(columns)
    rows = np.empty(n, dtype=[(name, column.dtype) for name, column in columns])
    for name, column in columns:
        rows[name] = column
    return rows


def require_different(columns: Columns) -> None:
    """Raise InputError for two columns of one name."""
    names = [name for name, _ in columns]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"two fields of the file would be called {', '.join(twice)}: rename one.")


def class_comments(classes: Classes | None) -> list[str]:
    """Return the comments that name the classes: `semgp class <label> <red> <green> <blue> <name>`.

    Raises
    ------
    InputError
        A class name that a line of text cannot hold.
    """
    lines = []
    for label, (name, (red, green, blue)) in enumerate(zip(classes.names, classes.colours) if classes else ()):
        if not name or name != name.strip() or "\n" in name or "\r" in name:
            raise InputError(f"a header cannot hold the class name {name!r}: rename the class.")
        lines.append(f"semgp class {label} {red} {green} {blue} {name}")
    return lines


def _column(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.generic]:
    column = np.asarray(values)
    if column.shape != shape:
        raise InputError(f"{name} must have shape {shape} to go with the points, not {column.shape}.")
    return column
