"""Tables of numbers behind a header, in binary or in text: the body of PLY and PCD files."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from semgp.errors import FileFormatError

LONGEST_LINE = 1 << 16
"""A header line beyond this many bytes is no header line."""


def header_line(path: Path, file: BinaryIO) -> str:
    """Return the next line of a header, without its end.

    Raises
    ------
    FileFormatError
        The file ends, or the line is no text.
    """
    line = file.readline(LONGEST_LINE)
    if not line.endswith(b"\n"):
        raise FileFormatError(path, "ends within its header, or has none.")
    try:
        return line.decode().strip()
    except UnicodeDecodeError as error:
        raise FileFormatError(path, "has a header that is no text.") from error


def whole_number(path: Path, what: str, word: str) -> int:
    """Return a number of a header.

    Raises
    ------
    FileFormatError
        The word is no whole number, or an absurd one.
    """
    if not (word.isascii() and word.isdecimal() and len(word) <= 15):
        raise FileFormatError(path, f"has a header with {what} {word[:40]!r}, which is no sensible number.")
    return int(word)


def row_type(path: Path, fields: Sequence[tuple[str, str]]) -> np.dtype[np.void]:
    """Return the structured type of a row, given the name and numpy type of each field.

    Raises
    ------
    FileFormatError
        No fields, or a name that occurs twice.
    """
    if not fields:
        raise FileFormatError(path, "has a header that declares points without fields.")
    try:
        return np.dtype(list(fields))
    except ValueError as error:
        raise FileFormatError(path, f"has a header whose fields cannot be told apart: {error}.") from error


def binary_table(path: Path, file: BinaryIO, row: np.dtype[np.void], count: int) -> dict[str, NDArray[Any]]:
    """Read the columns of `count` binary rows from where the file stands.

    Raises
    ------
    FileFormatError
        Fewer bytes left than the rows need; nothing is allocated before this is known.
    """
    _require_bytes(path, file, row, count)
    table = np.fromfile(file, row, count)
    return {name: table[name] for name in row.names or ()}


def skip_binary(path: Path, file: BinaryIO, row: np.dtype[np.void], count: int) -> None:
    """Pass over `count` binary rows.

    Raises
    ------
    FileFormatError
        Fewer bytes left than the rows need.
    """
    _require_bytes(path, file, row, count)
    file.seek(count * row.itemsize, os.SEEK_CUR)


def text_lines(file: BinaryIO) -> Iterator[bytes]:
    """Yield the lines of a file from where it stands, but for the blank ones."""
    return (line for line in file if not line.isspace())


def text_table(path: Path, lines: Iterator[bytes], row: np.dtype[np.void], count: int) -> dict[str, NDArray[Any]]:
    """Read the columns of `count` lines of numbers separated by spaces.

    Raises
    ------
    FileFormatError
        Too few lines, lines of other lengths than the row, or values that are no numbers of the field's type.
    """
    names = row.names or ()
    rows = list(islice(lines, count))
    if len(rows) < count:
        raise FileFormatError(
            path, f"is truncated or its header lies: {count} rows are declared, but {len(rows)} lines are left."
        )
    if not rows:
        return {name: np.empty(0, dtype=row[name]) for name in names}
    try:
        values = np.loadtxt(rows, dtype=np.float64, comments=None, ndmin=2)
    except ValueError as error:
        raise FileFormatError(path, f"has a line that is not {len(names)} numbers: {error}.") from error
    if values.shape[1] != len(names):
        raise FileFormatError(path, f"has lines of {values.shape[1]} numbers for {len(names)} fields.")
    return {name: _cast(path, name, values[:, i], row[name]) for i, name in enumerate(names)}


def _require_bytes(path: Path, file: BinaryIO, row: np.dtype[np.void], count: int) -> None:
    left = os.fstat(file.fileno()).st_size - file.tell()
    if count * row.itemsize > left:
        raise FileFormatError(
            path,
            f"is truncated or its header lies: {count} rows of {row.itemsize} bytes are declared, "
            f"but {left} bytes are left.",
        )


def _cast(path: Path, name: str, column: NDArray[np.float64], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return text values as the type that the header declares."""
    with np.errstate(invalid="ignore", over="ignore"):
        values = column.astype(dtype)
    if dtype.kind != "f" and not (values == column).all():
        raise FileFormatError(path, f"has values of {name} that are no {dtype}.")
    return values
