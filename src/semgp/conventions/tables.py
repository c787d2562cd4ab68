"""Class lists written as text, and the tables between them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING, Classes
from semgp.errors import InputError


def split_names(text: str) -> tuple[str, ...]:
    """Return the comma-separated items of a text."""
    return tuple(" ".join(item.split()) for item in text.split(","))


def coloured_classes(text: str) -> Classes:
    """Return the classes of a text of names, each followed by its colour rrggbb."""
    rows = [item.rsplit(" ", 1) for item in split_names(text)]
    colours = tuple((v >> 16, v >> 8 & 255, v & 255) for v in (int(colour, 16) for _, colour in rows))
    return Classes(tuple(name for name, _ in rows), colours)


def table_between(source: Classes, target: Classes, members: Mapping[str, str]) -> NDArray[np.int32]:
    """Return the target label of each source label, given the source names that each target name takes in."""
    table = np.full(len(source), MISSING, dtype=np.int32)
    for name, source_names in members.items():
        table[[source.index(s) for s in split_names(source_names)]] = target.index(name)
    table.setflags(write=False)
    return table


def relabel(labels: ArrayLike, table: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return labels of one list as labels of another; missing ones stay missing.

    Parameters
    ----------
    labels : integer array of any shape
        Labels from -1 to K - 1.
    table : (K,) array
        New label of each old one, such as `NYU40_TO_NYU13`.

    Raises
    ------
    InputError
        Labels outside the table.
    """
    old = whole_numbers(labels, MISSING, len(table) - 1)
    return np.asarray(np.append(table, MISSING)[old], dtype=np.int32)  # -1 picks the last entry


def whole_numbers(values: ArrayLike, low: int, high: int) -> NDArray[np.integer]:
    """Check that values are whole numbers from low to high."""
    a = np.asarray(values)
    if a.dtype.kind not in "iu":
        raise InputError(f"labels must be whole numbers, not {a.dtype}.")
    if a.size and (a.min() < low or a.max() > high):
        raise InputError(f"labels go from {a.min()} to {a.max()}, but must lie between {low} and {high}.")
    return a
