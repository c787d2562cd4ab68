"""The yaml files of SemanticKITTI's API: raw classes, and the training classes that they make up."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from semgp.class_files.rows import ClassFile, Row, from_rows, read_text
from semgp.errors import FileFormatError, MissingExtraError

DEEPEST = 8
"""Levels of a yaml file that are read; SemanticKITTI's have three."""

PARTS = ("labels", "learning_map", "learning_map_inv")


def read_semantic_kitti_yaml(path: Path) -> ClassFile:
    """Read the training classes of a SemanticKITTI yaml file, each with its raw ids and what it takes in by name.

    `learning_map` takes raw ids to training classes, of which those of `learning_ignore` are no classes (left out,
    class 0 is none); `learning_map_inv` gives the raw id, and so the name in `labels` and the colour, blue first,
    in `color_map`, of each training class. Raw ids that no training class takes in are missing labels.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, or makes no sense; the message names the key.
    MissingExtraError
        Without the extra `yaml`.
    """
    try:
        import yaml
    except ImportError as error:
        raise MissingExtraError("reading a class file in yaml", "yaml") from error
    text = read_text(path)
    try:
        _refuse_traps(path, yaml.scan(text, Loader=yaml.SafeLoader))
        content = yaml.safe_load(text)
    except FileFormatError:
        raise
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise FileFormatError(path, f"is no yaml: {' '.join(str(error).split())}.") from error
    if not isinstance(content, dict) or not all(isinstance(content.get(part), dict) for part in PARTS):
        raise FileFormatError(path, f"is no class file of SemanticKITTI: it needs {', '.join(PARTS)}.")
    return from_rows(path, _rows(path, content))


def _refuse_traps(path: Path, tokens: Iterable[Any]) -> None:
    """Raise FileFormatError for what lets a small file cost much: aliases, and things deep within each other."""
    depth = 0
    for token in tokens:
        kind = type(token).__name__
        depth += kind.endswith("StartToken") - kind.endswith("EndToken")
        if kind == "AliasToken" or depth > DEEPEST:
            raise FileFormatError(path, "has aliases, or things too deep within each other, which are not read.")


def _rows(path: Path, content: dict[str, Any]) -> list[Row]:
    names = {raw: _text(path, "labels", raw, name) for raw, name in _numbered(path, content, "labels")}
    of = {raw: _number(path, "learning_map", raw, c) for raw, c in _numbered(path, content, "learning_map")}
    raw_of = {c: _number(path, "learning_map_inv", c, i) for c, i in _numbered(path, content, "learning_map_inv")}
    colours = dict(_numbered(path, content, "color_map")) if "color_map" in content else {}
    ignored = dict(_numbered(path, content, "learning_ignore")) if "learning_ignore" in content else {0: True}
    rows = []
    for c in sorted(set(of.values())):
        if ignored.get(c):
            continue
        if c not in raw_of or raw_of[c] not in names:
            raise FileFormatError(path, f"learning_map_inv: class {c} has no raw id that labels name.")
        raw = raw_of[c]
        ids = tuple(i for i in of if of[i] == c)
        colour = _colour(path, raw, colours[raw]) if raw in colours else ""
        rows.append(Row(f"class {c}", names[raw], colour, ids, tuple(names[i] for i in ids if i in names)))
    return rows


def _numbered(path: Path, content: dict[str, Any], part: str) -> list[tuple[int, Any]]:
    """Return the entries of a part, whose keys must be whole numbers."""
    entries = content[part]
    if not isinstance(entries, dict) or not all(type(key) is int for key in entries):
        raise FileFormatError(path, f"{part}: its keys must be whole numbers.")
    return list(entries.items())


def _number(path: Path, part: str, key: int, value: Any) -> int:
    if type(value) is not int:
        raise FileFormatError(path, f"{part}: {key} must be a whole number, not {str(value)[:40]!r}.")
    return value


def _text(path: Path, part: str, key: int, value: Any) -> str:
    if not isinstance(value, str):
        raise FileFormatError(path, f"{part}: {key} must be a name, not {str(value)[:40]!r}.")
    return value


def _colour(path: Path, key: int, value: Any) -> str:
    """Return a colour, blue first in the file, as #rrggbb."""
    if not isinstance(value, list) or len(value) != 3 or not all(type(v) is int and 0 <= v <= 255 for v in value):
        raise FileFormatError(
            path, f"color_map: {key} must be three numbers from 0 to 255, not {str(value)[:40]!r}."
        )
    return f"#{bytes(value[::-1]).hex()}"
