"""PCD point files of the Point Cloud Library, version 0.7: ASCII, binary and compressed."""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError
from semgp.readers.fields import cloud_from_fields, listed_classes
from semgp.readers.table import binary_table, header_line, row_type, text_lines, text_table, whole_number

KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")

TYPES = {
    **{"I1": "i1", "I2": "i2", "I4": "i4", "I8": "i8", "U1": "u1", "U2": "u2", "U4": "u4", "U8": "u8"},
    **{"F4": "f4", "F8": "f8"},
}
"""PCD's TYPE and SIZE, as numpy's type."""

MOST_IN_FIELD = 4096
"""A field with more elements a point is no field of a cloud with labels."""


def read_pcd(
    path: str | Path,
    *,
    classes: Classes | None = None,
    features: Sequence[str] = (),
    field: str | None = None,
) -> LabelledCloud:
    """Read a PCD file; see `cloud_from_fields` for what its fields mean.

    Colours packed into a field `rgb` or `rgba` are understood too. A field of several elements becomes the
    columns `<name>_0`, `<name>_1` and so on. VIEWPOINT is not used: most writers leave its default, which
    would put the sensor at the origin.

    Parameters
    ----------
    path : str or Path
        The file.
    classes : Classes, optional
        Classes of the labels. Left out, those of comments `semgp class <label> <red> <green> <blue> <name>`, as
        semgp writes them; or named after the soft labels; or numbered.
    features : sequence of str
        Fields that become the cloud's features.
    field : str, optional
        The field that holds the labels, where it is none of `fields.LABEL_NAMES`.

    Raises
    ------
    FileFormatError
        A file that is no PCD file, is damaged or truncated, or has no x, y and z.
    """
    path = Path(path)
    with path.open("rb") as file:
        header, class_lines = _read_header(path, file)
        row, count = row_type(path, _fields(path, header)), _n_points(path, header)
        match header["DATA"]:
            case ["ascii"]:
                columns = text_table(path, text_lines(file), row, count)
            case ["binary"]:
                columns = binary_table(path, file, row, count)
            case ["binary_compressed"]:
                columns = _compressed_table(path, file, row, count)
            case other:
                raise FileFormatError(
                    path, f"has DATA {' '.join(other)[:40]}; known are ascii, binary and binary_compressed."
                )
    classes = classes or listed_classes(path, class_lines)
    return cloud_from_fields(path, _unpacked(columns), classes, features, field)


def _read_header(path: Path, file: BinaryIO) -> tuple[dict[str, list[str]], list[str]]:
    """Return the words of each header line, up to DATA, and the comments that list the classes."""
    header: dict[str, list[str]] = {}
    class_lines: list[str] = []
    while "DATA" not in header:
        match (line := header_line(path, file)).split():
            case ["#", "semgp", "class", *_]:
                class_lines.append(line.removeprefix("#").strip())
            case [key, *words] if key in KEYS and key not in header:
                header[key] = words
            case [key, *_] if not key.startswith("#"):
                raise FileFormatError(path, f"is no PCD file or damaged: {key[:40]!r} heads a header line.")
    if missing := [key for key in ("FIELDS", "SIZE", "TYPE") if key not in header]:
        raise FileFormatError(path, f"has a PCD header without {', '.join(missing)}.")
    return header, class_lines


def _compressed_table(path: Path, file: BinaryIO, row: np.dtype[np.void], count: int) -> dict[str, NDArray[Any]]:
    """Return the columns of a body that is packed by LZF, one column after the other."""
    from semgp.readers.lzf import unpacked

    sizes = file.read(8)
    packed, size = struct.unpack("<II", sizes) if len(sizes) == 8 else (0, -1)
    left = os.fstat(file.fileno()).st_size - file.tell()
    if size != count * row.itemsize or packed > left:
        raise FileFormatError(
            path,
            f"is truncated or its header lies: {count} rows of {row.itemsize} bytes are declared, but {packed} "
            f"bytes of {left} are said to unpack to {size}.",
        )
    body = unpacked(path, file.read(packed), size)
    columns, at = {}, 0
    for name in row.names or ():
        end = at + count * row[name].itemsize
        columns[name] = body[at:end].view(row[name])
        at = end
    return columns


def _fields(path: Path, header: dict[str, list[str]]) -> list[tuple[str, str]]:
    """Return the name and type of each column; padding, which PCL calls "_", gets a name of its own."""
    names = header["FIELDS"]
    codes = [kind + size for kind, size in zip(header["TYPE"], header["SIZE"])]
    counts = [whole_number(path, "COUNT", word) for word in header.get("COUNT", ["1"] * len(names))]
    if not len(names) == len(header["SIZE"]) == len(header["TYPE"]) == len(counts):
        raise FileFormatError(path, "has FIELDS, SIZE, TYPE and COUNT of different lengths.")
    if unknown := sorted(set(codes) - TYPES.keys()):
        raise FileFormatError(path, f"has fields of the unknown type and size {', '.join(unknown)[:40]}.")
    if max(counts, default=0) > MOST_IN_FIELD:
        raise FileFormatError(path, f"has a field of {max(counts)} elements a point.")
    fields: list[tuple[str, str]] = []
    for i, (name, code, count) in enumerate(zip(names, codes, counts)):
        name = f"padding_{i}" if name == "_" else name
        fields += [(name if count == 1 else f"{name}_{k}", "<" + TYPES[code]) for k in range(count)]
    return fields


def _n_points(path: Path, header: dict[str, list[str]]) -> int:
    """Return the number of points: POINTS, or WIDTH times HEIGHT."""
    if "POINTS" in header:
        return whole_number(path, "POINTS", " ".join(header["POINTS"]))
    width, height = (whole_number(path, key, " ".join(header.get(key, []))) for key in ("WIDTH", "HEIGHT"))
    return width * height


def _unpacked(columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the columns, with a 4-byte `rgb` or `rgba` taken apart into red, green and blue."""
    packed = next((columns[name] for name in ("rgb", "rgba") if name in columns), None)
    if packed is None or packed.dtype.itemsize != 4:
        return columns
    bits = np.ascontiguousarray(packed).view("<u4")
    return columns | {name: bits >> shift & 255 for name, shift in (("red", 16), ("green", 8), ("blue", 0))}
