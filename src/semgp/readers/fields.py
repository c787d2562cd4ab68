"""From the named columns of a point file to a labelled cloud."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError

Columns = Mapping[str, NDArray[Any]]

LABEL_NAMES = ("label", "class", "classification")
"""Names under which point files keep hard labels; the first that occurs is taken."""

SHORT_NAMES = {"r": "red", "g": "green", "b": "blue"}
"""Names that some files cut short."""

MOST_NUMBERED_CLASSES = 1000
"""A file that names no classes may have labels below this; above, its labels are hardly class numbers."""


def cloud_from_fields(
    path: Path,
    fields: Columns,
    classes: Classes | None = None,
    features: Sequence[str] = (),
    field: str | None = None,
    T_world_sensor: NDArray[np.float64] | None = None,
) -> LabelledCloud:
    """Return the cloud that the columns of a point file describe.

    Names are compared in lower case and without the prefix "scalar_" that CloudCompare writes.
    Coordinates are `x`, `y`, `z` in metres; points with a NaN coordinate, which is how organised clouds mark
    pixels without a return, are left out. Colours are `red`, `green`, `blue`. Hard labels are one of
    `LABEL_NAMES`, or the field that is named; NaN, -1 and the largest value of an unsigned type are missing
    labels. Soft labels are `p_<class name>` or `prob_<number>`; where a file has both, the soft ones are taken,
    and the hard label only tells which points have none.

    Parameters
    ----------
    path : Path
        The file, for error messages.
    fields : mapping of str to (N,) array
        The columns.
    classes : Classes, optional
        Classes of the labels; where it has raw ids, labels that are none of them are missing. Left out, they are
        named after the `p_` columns, or numbered.
    features : sequence of str
        Columns that become the cloud's features.
    field : str, optional
        The column of the hard labels, where it is none of `LABEL_NAMES`, or where the soft ones are not wanted.
    T_world_sensor : (4, 4) array, optional
        Pose of the sensor; the points are in the world frame all the same.

    Raises
    ------
    FileFormatError
        Columns that are missing or hold what they cannot mean.
    """
    columns = {_short(name): column for name, column in fields.items()}
    features, field = tuple(map(_short, features)), field and _short(field)
    wanted = ("x", "y", "z", *features, *([field] if field else []))
    if missing := [name for name in wanted if name not in columns]:
        raise FileFormatError(path, f"has no {', '.join(missing)}; its fields are {', '.join(fields) or 'none'}.")
    points = _stack(columns, ("x", "y", "z"), np.float64)
    kept = ~np.isnan(points).any(axis=1)
    label_names = [field] if field else [name for name in LABEL_NAMES if name in columns]
    labels = _hard_labels(path, columns[label_names[0]]) if label_names else None
    soft_names = [] if field else _soft_names(path, columns)
    weights = _stack(columns, soft_names, np.float32) if soft_names else None
    if classes is None:
        classes = _classes_of(path, labels, soft_names)
    elif labels is not None and weights is None:
        labels = classes.from_ids(labels)
    if weights is not None and labels is not None:
        weights[labels == MISSING] = 0
        labels = None
    try:
        return LabelledCloud(
            points=points[kept],
            classes=classes,
            labels=None if labels is None else labels[kept],
            weights=None if weights is None else weights[kept],
            colours=_colours(path, columns, kept),
            features=_stack(columns, features, np.float32)[kept] if features else None,
            feature_names=features,
            T_world_sensor=T_world_sensor,
        )
    except InputError as error:
        raise FileFormatError(path, str(error)) from error


def numbered_classes(path: Path, labels: NDArray[np.integer] | None) -> Classes:
    """Return numbered classes, as many as the hard labels of a file that names none need.

    Raises
    ------
    FileFormatError
        Labels of `MOST_NUMBERED_CLASSES` or above.
    """
    highest = int(labels.max(initial=0)) if labels is not None else 0
    if highest >= MOST_NUMBERED_CLASSES:
        raise FileFormatError(
            path, f"has labels up to {highest}, too many to number: give the classes that they speak of."
        )
    return Classes.numbered(highest + 1)


def listed_classes(path: Path, lines: Sequence[str]) -> Classes | None:
    """Return the classes that a file lists in the words of semgp's writers; None for no lines.

    Parameters
    ----------
    path : Path
        The file, for error messages.
    lines : sequence of str
        Lines `semgp class <label> <red> <green> <blue> <name>`.

    Raises
    ------
    FileFormatError
        Lines that make no sense, or do not count up from 0.
    """
    if not lines:
        return None
    rows = [line.split(maxsplit=6)[2:] for line in lines]
    try:
        labels = [int(label) for label, *_ in rows]
        colours = tuple((int(red), int(green), int(blue)) for _, red, green, blue, _ in rows)
        classes = Classes(tuple(name for *_, name in rows), colours)
    except (ValueError, InputError) as error:
        raise FileFormatError(path, f"has class comments that make no sense: {error}.") from error
    if labels != list(range(len(labels))):
        raise FileFormatError(path, "has class comments that do not count up from 0.")
    return classes


def _short(name: str) -> str:
    """Return a column's name as it is compared."""
    name = name.lower().removeprefix("scalar_")
    return SHORT_NAMES.get(name, name)


def _stack(columns: Columns, names: Sequence[str], dtype: type[np.generic]) -> NDArray[Any]:
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite the cloud refuses
        return np.stack([columns[name].astype(dtype) for name in names], axis=1)


def _hard_labels(path: Path, column: NDArray[Any]) -> NDArray[np.int64]:
    if column.dtype.kind == "f":
        whole = np.where(np.isnan(column), MISSING, column)
        if (np.abs(whole) > 2**31).any() or (whole != np.round(whole)).any():
            raise FileFormatError(path, "has labels that are not whole numbers.")
        return whole.astype(np.int64)
    labels = column.astype(np.int64)
    if column.dtype.kind == "u":
        labels[column == np.iinfo(column.dtype).max] = MISSING
    return labels


def _soft_names(path: Path, columns: Columns) -> list[str]:
    """Return the names of the soft label columns, in class order."""
    if named := [name for name in columns if name.startswith("p_")]:
        return named
    numbers = sorted(int(m[1]) for name in columns if (m := re.fullmatch(r"prob_(\d{1,4})", name)))
    if numbers != list(range(len(numbers))):
        raise FileFormatError(path, f"has soft labels prob_{numbers}, which do not count up from 0.")
    return [f"prob_{c}" for c in numbers]


def _classes_of(path: Path, labels: NDArray[np.int64] | None, soft_names: Sequence[str]) -> Classes:
    """Return the classes of a file that does not list them."""
    if soft_names:
        if soft_names[0].startswith("p_"):
            return Classes(tuple(name.removeprefix("p_") for name in soft_names))
        return Classes.numbered(len(soft_names))
    return numbered_classes(path, labels)


def _colours(path: Path, columns: Columns, kept: NDArray[np.bool_]) -> NDArray[np.uint8] | None:
    names = ("red", "green", "blue")
    if not all(name in columns for name in names):
        return None
    rgb = np.stack([columns[name] for name in names], axis=1)[kept]
    with np.errstate(invalid="ignore"):  # a NaN is no whole number
        whole = (rgb >= 0) & (rgb <= 255) & (rgb == np.round(rgb))
    if not whole.all():
        raise FileFormatError(path, "has colours that are not whole numbers from 0 to 255.")
    return rgb.astype(np.uint8)
