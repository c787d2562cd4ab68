"""Class files as TOML: tables [[class]] in the order of the labels."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from semgp.class_files.rows import ClassFile, Row, from_rows, read_text
from semgp.errors import FileFormatError
from semgp.writers import atomic_write

KEYS = {"name": str, "colour": str, "ids": int, "from": str}
LISTS = ("ids", "from")


def read_toml(path: Path) -> ClassFile:
    """Read a class file in TOML.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, or makes no sense; the message names the line or the key.
    """
    try:
        tables = tomllib.loads(read_text(path)).get("class")
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise FileFormatError(path, f"is no TOML: {error}.") from error
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        raise FileFormatError(path, "is no class file: it has no tables [[class]].")
    return from_rows(path, [_row(path, f"class {c}", table) for c, table in enumerate(tables)])


def write_toml(path: Path, content: ClassFile) -> None:
    """Write a class file in TOML, whole or not at all."""
    classes = content.classes
    parts = []
    for c, (name, colour) in enumerate(zip(classes.names, classes.colours)):
        lines = ["[[class]]", f"name = {_quoted(name)}", f'colour = "#{bytes(colour).hex()}"']
        if classes.ids:
            lines.append(f"ids = {list(classes.ids[c])}")
        if content.members and content.members[c]:
            lines.append(f"from = [{', '.join(_quoted(member) for member in content.members[c])}]")
        parts.append("\n".join(lines) + "\n")
    with atomic_write(path) as temporary:
        temporary.write_text("\n".join(parts), encoding="utf-8")


def _row(path: Path, where: str, table: dict[str, Any]) -> Row:
    for key, value in table.items():
        if key not in KEYS:
            raise FileFormatError(path, f"{where}: has no key {key!r}; the keys are {', '.join(KEYS)}.")
        items = value if key in LISTS and isinstance(value, list) else [value]
        listed = key not in LISTS or isinstance(value, list)
        if not listed or any(type(item) is not KEYS[key] for item in items):
            kind = f"a list of {KEYS[key].__name__}" if key in LISTS else "a text"
            raise FileFormatError(path, f"{where}: {key} must be {kind}, not {str(value)[:40]!r}.")
    ids = tuple(table["ids"]) if "ids" in table else None
    return Row(where, table.get("name", ""), table.get("colour", ""), ids, tuple(table.get("from", ())))


def _quoted(text: str) -> str:
    """Return a TOML basic string: JSON's escapes are all TOML's."""
    return json.dumps(text, ensure_ascii=False)
