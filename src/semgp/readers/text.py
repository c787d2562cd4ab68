"""Points as lines of text: .csv, .xyz, .txt and .asc files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError
from semgp.readers.fields import cloud_from_fields
from semgp.readers.protocol import FileReader

NAMES_BY_NUMBER = {3: "x y z", 4: "x y z label", 6: "x y z red green blue"}
"""What the columns of a file without header are, by their number."""

SHOWN = 60
"""Letters of a line that an error shows."""


def read_text(
    path: str | Path,
    *,
    classes: Classes | None = None,
    features: Sequence[str] = (),
    field: str | None = None,
    columns: Sequence[str] = (),
) -> LabelledCloud:
    """Read a text file of one point a line; see `cloud_from_fields` for what its columns mean.

    The numbers of a line are separated by commas or semicolons, whichever the first line of numbers has, or by
    blanks. The last line before the numbers, if there is one, names the columns, such as `x y z r g b label
    intensity`; a `#` or `//` before the names is passed over.

    Parameters
    ----------
    path : str or Path
        The file.
    classes : Classes, optional
        Classes of the labels. Left out, they are named after the soft labels, or numbered.
    features : sequence of str
        Columns that become the cloud's features.
    field : str, optional
        The column that holds the labels, where it is none of `fields.LABEL_NAMES`.
    columns : sequence of str
        Names of the columns, instead of those in the file. Without any, they are taken from `NAMES_BY_NUMBER`.

    Raises
    ------
    FileFormatError
        A line that is not as many numbers as there are columns, a header without x, y and z, or no header and a
        number of columns that does not tell what they are.
    """
    path = Path(path)
    try:
        with path.open(encoding="utf-8-sig") as file:
            header, n_before, first = _head(path, file)
            delimiter = _delimiter(first)
            width = len(first.split(delimiter))
            names = _names(path, columns, header, width)
            file.seek(0)
            values = np.loadtxt(file, comments=None, delimiter=delimiter, skiprows=n_before, ndmin=2)
    except FileFormatError:
        raise
    except UnicodeDecodeError as error:
        raise FileFormatError(path, "is no text.") from error
    except ValueError as error:
        raise FileFormatError(path, _blame(path, n_before, width, delimiter) or str(error)) from error
    return cloud_from_fields(path, dict(zip(names, values.T)), classes, features, field)


def _head(path: Path, file: TextIO) -> tuple[str, int, str]:
    """Return the last line before the numbers, how many there are before them, and the first line of numbers."""
    header, n_before = "", 0
    for line in file:
        if _are_numbers(line.split(_delimiter(line))):
            return header, n_before, line
        header, n_before = line.strip() or header, n_before + 1
    raise FileFormatError(path, "has no line of numbers.")


def _names(path: Path, columns: Sequence[str], header: str, width: int) -> list[str]:
    """Return the names of the columns: those given, those of the header, or those that go without saying."""
    bare = header.lstrip("#/ ")
    names = list(columns) or [name.strip("\"' ") for name in re.split(r"[,;\t]|\s+", bare) if name.strip()]
    if not columns and bare != header and "x" not in [name.lower() for name in names]:
        names = []  # a comment that names nothing
    names = names or NAMES_BY_NUMBER.get(width, "").split()
    if not names:
        raise FileFormatError(
            path,
            f"has {width} columns, but no header: write a line with their names above them, such as "
            "x,y,z,red,green,blue,label,intensity.",
        )
    if len(set(names)) < len(names) or len(names) != width:
        raise FileFormatError(path, f"has {width} columns, for the names {', '.join(names)[:200]}.")
    return names


def _blame(path: Path, n_before: int, width: int, delimiter: str | None) -> str | None:
    """Return what is wrong with the first line that is not so many numbers."""
    with path.open(encoding="utf-8-sig") as file:
        for number, line in enumerate(file, 1):
            words = line.split(delimiter)
            if number > n_before and line.strip() and not (len(words) == width and _are_numbers(words)):
                return f"line {number} is not {width} numbers: {line.strip()[:SHOWN]!r}."
    return None


def _delimiter(line: str) -> str | None:
    """Return what separates the words of a line; None is any blanks."""
    return next((mark for mark in ",;" if mark in line), None)


def _are_numbers(words: Sequence[str]) -> bool:
    try:
        return len([float(word) for word in words]) > 0
    except ValueError:
        return False


TEXT_FILES = tuple(
    FileReader(name, f"a .{name} file of one point a line", f".{name}", read_text)
    for name in ("csv", "xyz", "txt", "asc")
)
"""The readers, one for each extension that such files have."""
