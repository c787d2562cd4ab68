"""Class files as csv: the columns name, colour, ids and from, a row a class in the order of the labels."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from semgp.class_files.rows import ClassFile, Row, from_rows, read_text
from semgp.errors import FileFormatError, InputError
from semgp.writers import atomic_write

COLUMNS = ("name", "colour", "ids", "from")


def read_csv(path: Path) -> ClassFile:
    """Read a class file in csv.

    Items of ids are separated by spaces or `;`, those of from by `;`, for names may have spaces in them.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, or makes no sense; the message names the line.
    """
    reader = csv.DictReader(read_text(path).splitlines(), skipinitialspace=True, strict=True)
    try:
        columns = [column.strip().lower() for column in reader.fieldnames or ()]
        if "name" not in columns or not set(columns) <= set(COLUMNS) or len(set(columns)) < len(columns):
            raise FileFormatError(path, f"line 1: the columns are {', '.join(COLUMNS)}; name must be there.")
        reader.fieldnames = columns
        return from_rows(path, [_row(path, f"line {reader.line_num}", cells) for cells in reader])
    except csv.Error as error:
        raise FileFormatError(path, f"line {reader.line_num}: is no csv: {error}.") from error


def write_csv(path: Path, content: ClassFile) -> None:
    """Write a class file in csv, whole or not at all.

    Raises
    ------
    InputError
        A class without ids among others with some: an empty cell would give it its label.
    """
    classes = content.classes
    if classes.ids and not all(classes.ids):
        raise InputError(f"{path}: csv cannot say that a class has no ids; write .toml.")
    with atomic_write(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for c, (name, colour) in enumerate(zip(classes.names, classes.colours)):
            ids = classes.ids[c] if classes.ids else ()
            members = content.members[c] if content.members else ()
            writer.writerow([name, f"#{bytes(colour).hex()}", ";".join(map(str, ids)), ";".join(members)])


def _row(path: Path, where: str, cells: dict[str | None, str | None]) -> Row:
    if None in cells or None in cells.values():
        raise FileFormatError(path, f"{where}: has more or fewer cells than the first line.")
    name, colour, ids, members = ((cells.get(column) or "").strip() for column in COLUMNS)
    words = re.split(r"[;\s]+", ids) if ids else []
    if not all(re.fullmatch(r"[0-9]{1,10}", word) for word in words if word):
        raise FileFormatError(path, f"{where}: ids are whole numbers, not {ids[:40]!r}.")
    numbers = tuple(int(word) for word in words if word)
    parts = (member.strip() for member in members.split(";"))
    return Row(where, name, colour, numbers or None, tuple(member for member in parts if member))
