"""PLY point files (Turk, 1994): ASCII, binary little-endian and binary big-endian."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError
from semgp.readers.fields import cloud_from_fields, listed_classes
from semgp.readers.table import (
    binary_table,
    header_line,
    row_type,
    skip_binary,
    text_lines,
    text_table,
    whole_number,
)

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"},
}
"""PLY's names of types, as numpy's."""

BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass
class _Element:
    """Some rows of the file and the (name, type) of each property."""

    name: str
    count: int
    properties: list[tuple[str, str]] = field(default_factory=list)
    has_list: bool = False


@dataclass
class _Header:
    form: str = ""
    elements: list[_Element] = field(default_factory=list)
    class_rows: list[str] = field(default_factory=list)


def read_ply(
    path: str | Path,
    *,
    classes: Classes | None = None,
    features: Sequence[str] = (),
    field: str | None = None,
) -> LabelledCloud:
    """Read the vertices of a PLY file; see `cloud_from_fields` for what their properties mean.

    Parameters
    ----------
    path : str or Path
        The file.
    classes : Classes, optional
        Classes of the labels. Left out, those of comments `semgp class <label> <red> <green> <blue> <name>`, as
        semgp writes them; or named after the soft labels; or numbered.
    features : sequence of str
        Properties that become the cloud's features.
    field : str, optional
        The property that holds the labels, where it is none of `fields.LABEL_NAMES`.

    Raises
    ------
    FileFormatError
        A file that is no PLY file, is damaged or truncated, or has no vertices with x, y and z.
    """
    path = Path(path)
    with path.open("rb") as file:
        header = _read_header(path, file)
        fields = _read_vertices(path, file, header)
    return cloud_from_fields(path, fields, classes or listed_classes(path, header.class_rows), features, field)


def _read_header(path: Path, file: BinaryIO) -> _Header:
    if file.read(3) != b"ply" or header_line(path, file):
        raise FileFormatError(path, "is no PLY file: its first line is not 'ply'.")
    header = _Header()
    while (line := header_line(path, file)) != "end_header":
        match line.split():
            case ["format", form, "1.0"] if form in BYTE_ORDERS and not header.form:
                header.form = form
            case ["element", name, count]:
                header.elements.append(_Element(name, whole_number(path, f"element {name}", count)))
            case ["property", "list", _, _, _] if header.elements:
                header.elements[-1].has_list = True
            case ["property", kind, name] if header.elements and kind in TYPES:
                header.elements[-1].properties.append((name, TYPES[kind]))
            case ["comment", "semgp", "class", *_]:
                header.class_rows.append(line.removeprefix("comment").strip())
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise FileFormatError(path, f"has a PLY header line that makes no sense: {line[:80]!r}.")
    if not header.form:
        raise FileFormatError(path, "has a PLY header without a format line.")
    return header


def _read_vertices(path: Path, file: BinaryIO, header: _Header) -> dict[str, NDArray[Any]]:
    """Return the columns of the element called vertex, having passed over the elements before it."""
    order = BYTE_ORDERS[header.form]
    lines = text_lines(file)
    for element in header.elements:
        wanted = element.name == "vertex"
        if not wanted and not order:
            deque(islice(lines, element.count), maxlen=0)
            continue
        if element.has_list:
            raise FileFormatError(
                path, f"has lists in or before its vertices (element {element.name}): write the vertices first."
            )
        row = row_type(path, [(name, order + kind) for name, kind in element.properties])
        if wanted and order:
            return binary_table(path, file, row, element.count)
        if wanted:
            return text_table(path, lines, row, element.count)
        skip_binary(path, file, row, element.count)
    raise FileFormatError(path, "has no element called vertex.")
