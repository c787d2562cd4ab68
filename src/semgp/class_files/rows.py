"""What a class file says, in any format: a row a class."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes, repeated
from semgp.errors import FileFormatError, InputError

LARGEST_FILE = 1 << 20
"""Bytes; a list of classes that is longer is none."""

HIGHEST_ID = 2**32 - 1


@dataclass(frozen=True)
class ClassFile:
    """A class list, and what each class takes in from another.

    Parameters
    ----------
    classes : Classes
        Names, colours and raw ids.
    members : tuple of tuples of str, optional
        For each class the names of another list that become it; left out, none.

    Raises
    ------
    InputError
        Members that do not fit the classes, or a name that becomes two classes.
    """

    classes: Classes
    members: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        if self.members and len(self.members) != len(self.classes):
            raise InputError(f"{len(self.classes)} classes but members for {len(self.members)}.")
        if twice := sorted(repeated(chain.from_iterable(self.members))):
            raise InputError(f"{twice[0]!r} becomes more than one class.")

    @classmethod
    def from_table(cls, source: Classes, target: Classes, table: NDArray[np.int32]) -> ClassFile:
        """Return the remapping that a table from one list's labels to the other's stands for."""
        members = (tuple(np.array(source.names)[table == label].tolist()) for label in range(len(target)))
        return cls(target, tuple(members))


@dataclass(frozen=True)
class Row:
    """One class as a file gives it; `where` names its place for error messages."""

    where: str
    name: str
    colour: str = ""
    ids: tuple[int, ...] | None = None
    members: tuple[str, ...] = ()


def read_text(path: Path) -> str:
    """Return the text of a class file.

    Raises
    ------
    FileFormatError
        A file that is missing, no text, or far too long.
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise FileFormatError(path, f"is no class file: it has more than {LARGEST_FILE:,} bytes.")
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(path, "is no class file: it is no UTF-8 text.") from error
    except OSError as error:
        raise FileFormatError(path, f"cannot be read: {error.strerror or error}.") from error


def from_rows(path: Path, rows: Sequence[Row]) -> ClassFile:
    """Return what the rows of a class file say.

    A row without ids is meant by its label, its position; where no row has any, files hold the labels.

    Raises
    ------
    FileFormatError
        Rows that make no sense, together or alone.
    """
    for row in rows:
        if not row.name.strip() or not row.name.isprintable():
            raise FileFormatError(path, f"{row.where}: a class needs a name, not {row.name!r}.")
        for i in row.ids or ():
            if not 0 <= i <= HIGHEST_ID:
                raise FileFormatError(path, f"{row.where}: ids are whole numbers from 0 to {HIGHEST_ID}, not {i}.")
    ids = tuple((c,) if row.ids is None else row.ids for c, row in enumerate(rows))
    some_ids = any(row.ids is not None for row in rows)
    some_colours = any(row.colour for row in rows)
    try:
        names = tuple(row.name for row in rows)
        chosen = Classes(names).colours
        colours = tuple(colour_of(path, row) if row.colour else chosen[c] for c, row in enumerate(rows))
        classes = Classes(names, colours if some_colours else (), ids if some_ids else ())
        return ClassFile(classes, tuple(row.members for row in rows) if any(row.members for row in rows) else ())
    except FileFormatError:
        raise
    except InputError as error:
        raise FileFormatError(path, str(error)) from error


def colour_of(path: Path, row: Row) -> tuple[int, int, int]:
    """Return the colour that a row gives as #rrggbb."""
    if not re.fullmatch("#[0-9a-fA-F]{6}", row.colour):
        raise FileFormatError(path, f"{row.where}: a colour is written #rrggbb, not {row.colour!r}.")
    red, green, blue = bytes.fromhex(row.colour[1:])
    return red, green, blue
