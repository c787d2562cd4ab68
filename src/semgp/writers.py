"""Write point files: PLY for viewers such as CloudCompare, npz for semgp. A file is whole or not there."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError

Columns = list[tuple[str, NDArray[np.generic]]]

LARGEST_ROUNDING = 1e-4
"""Coordinates that float32 would move by more than this many metres are written as float64."""


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path to write to, and rename it to `path` once the block has ended well.

    Readers see the old file or the new one, never half of one; after an error the old one stays and the
    temporary one is removed. The temporary file lies in the same folder and has the same suffix.

    Parameters
    ----------
    path : str or Path
        Where the file is to be.

    Raises
    ------
    InputError
        The folder does not exist.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"cannot write {path}: the folder {path.parent} does not exist.")
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(6)}{path.suffix}")
    try:
        yield temporary
        with temporary.open("rb+") as written:
            os.fsync(written.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


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
        rgb = _column("colours", colours, (n, 3))
        if rgb.dtype != np.uint8:
            raise InputError(f"colours must be uint8, not {rgb.dtype}.")
        columns += zip(("red", "green", "blue"), rgb.T)
    if probability is not None:
        if classes is None:
            raise InputError("probability needs classes, which name its columns.")
        p = _column("probability", probability, (n, len(classes))).astype("<f4")
        columns += zip(("p_" + re.sub(r"\s", "_", name) for name in classes.names), p.T)
    columns += [(name, _number_column(name, values, n)) for name, values in fields.items()]
    header, rows = ply_header(columns, n, classes), structured(columns, n)
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        file.write(header)
        rows.tofile(file)


def write_npz(path: str | Path, cloud: LabelledCloud, **arrays: ArrayLike) -> None:
    """Write a cloud with all that it holds as a compressed npz file of the layout that `readers.npz` documents.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists.
    cloud : LabelledCloud
        The cloud.
    **arrays
        Further arrays under their own names, such as `confidence` or `variance`; the reader ignores them.

    Raises
    ------
    InputError
        An array under a name that the layout uses, or one of Python objects.
    """
    parts = {
        "points": cloud.points,
        "names": np.array(cloud.classes.names),
        "palette": cloud.classes.palette,
        "labels": cloud.labels,
        "weights": cloud.weights,
        "colours": cloud.colours,
        "features": cloud.features,
        "feature_names": np.array(cloud.feature_names) if cloud.feature_names else None,
        "T_world_sensor": cloud.T_world_sensor,
        "pixels": cloud.pixels,
        "image_shape": cloud.image_shape,
    }
    further = {name: np.asarray(a) for name, a in arrays.items()}
    if taken := sorted(parts.keys() & further.keys()):
        raise InputError(f"{', '.join(taken)} of the file are the cloud's: put them into the cloud.")
    if objects := sorted(name for name, a in further.items() if a.dtype.hasobject):
        raise InputError(f"{', '.join(objects)} must be an array of numbers or texts, not of Python objects.")
    present = {name: np.asarray(part) for name, part in parts.items() if part is not None}
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **present, **further)


def coordinates(points: ArrayLike) -> Columns:
    """Return the columns x, y and z of a PLY file: float32, or float64 where that would lose `LARGEST_ROUNDING`.

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


def _column(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.generic]:
    column = np.asarray(values)
    if column.shape != shape:
        raise InputError(f"{name} must have shape {shape} to go with the points, not {column.shape}.")
    return column


def _number_column(name: str, values: ArrayLike, n: int) -> NDArray[np.generic]:
    """Return a property's values as int32 or float32."""
    if not re.fullmatch(r"[!-~]+", name):
        raise InputError(f"{name!r} cannot name a PLY property: use ASCII letters, digits and _.")
    column = _column(name, values, (n,))
    if column.dtype.kind == "f":
        return column.astype("<f4")
    if column.dtype.kind not in "iub":
        raise InputError(f"{name} must be numbers, not {column.dtype}.")
    if n and (column.max() > 2**31 - 1 or column.min() < -(2**31)):
        raise InputError(f"{name} goes from {column.min()} to {column.max()}: a PLY property has 32 bits.")
    return column.astype("<i4")


def structured(columns: Columns, n: int) -> NDArray[np.void]:
    """Return the columns as one structured array."""
    names = [name for name, _ in columns]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"two properties of the PLY file would be called {', '.join(twice)}: rename one.")
    rows = np.empty(n, dtype=[(name, column.dtype) for name, column in columns])
    for name, column in columns:
        rows[name] = column
    return rows


def ply_header(columns: Columns, n: int, classes: Classes | None, *further: str) -> bytes:
    """Return the header of a binary PLY file of n vertices, with further lines before its end.

    Raises
    ------
    InputError
        A class name that a line of text cannot hold.
    """
    types = {"f4": "float", "f8": "double", "u1": "uchar", "i4": "int"}
    lines = ["ply", "format binary_little_endian 1.0", "comment written by semgp"]
    for label, (name, (red, green, blue)) in enumerate(zip(classes.names, classes.colours) if classes else ()):
        if not name or name != name.strip() or "\n" in name or "\r" in name:
            raise InputError(f"a PLY header cannot hold the class name {name!r}: rename the class.")
        lines.append(f"comment semgp class {label} {red} {green} {blue} {name}")
    lines.append(f"element vertex {n}")
    lines += [f"property {types[column.dtype.str[1:]]} {name}" for name, column in columns]
    return "\n".join([*lines, *further, "end_header", ""]).encode()
