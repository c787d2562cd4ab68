"""What is checked of a LAS file before laspy and lazrs read it.

They believe what a file says of its own sizes: of records before the points, of points, and of compressed chunks.
Each number is held against the length of the file first.

Offsets are those of the LAS Specification 1.4-R15, section 2.4, and of the LAZ Specification 1.4-R1, sections 2
and 3.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import Any, BinaryIO

from semgp.errors import FileFormatError

RECORD_HEADER = 54
"""Bytes of a record before the points, at least."""

LARGEST_UNPACKED, LARGEST_RATIO = 1 << 30, 1000
"""A compressed file may unpack to so many bytes, or to so many times its own size if that is more."""


def check_records(path: Path, file: BinaryIO) -> None:
    """Check the number of records before the points, and leave the file at its start.

    Raises
    ------
    FileFormatError
        No LAS file, or one that is too short for its records.
    """
    head = file.read(104)
    if len(head) < 104 or head[:4] != b"LASF":
        raise FileFormatError(path, "is no LAS file: it does not begin with LASF.")
    first_point, n_records = struct.unpack("<II", head[96:104])
    if first_point > _size(file) or n_records * RECORD_HEADER > first_point:
        raise FileFormatError(
            path, f"is truncated or its header lies: {n_records} records before byte {first_point} are declared."
        )
    file.seek(0)


def check_points(path: Path, file: BinaryIO, header: Any) -> None:
    """Check that the points of a header of laspy's can be in the file, and leave the file at their start.

    Raises
    ------
    FileFormatError
        More points than the file has room for, or a compression that does not fit them.
    """
    start, n, size = header.offset_to_point_data, header.point_count, header.point_format.size
    if header.are_points_compressed:
        if n * size > max(LARGEST_UNPACKED, LARGEST_RATIO * _size(file)):
            raise FileFormatError(path, f"would unpack to {n * size:,} bytes: refused as a decompression bomb.")
        if n:
            _check_items(path, header)
            _check_chunks(path, file, start, size)
    elif n * size > _size(file) - start:
        raise FileFormatError(
            path,
            f"is truncated or its header lies: {n} points of {size} bytes are declared, but {_size(file) - start} "
            "bytes are left.",
        )
    file.seek(start)


def _check_items(path: Path, header: Any) -> None:
    """Check that the parts of a compressed point are those of the header's point format."""
    import lazrs

    form = header.point_format
    found = header.vlrs[header.vlrs.index("LasZipVlr")].record_data
    expected = lazrs.LazVlr.new_for_compression(form.id, form.num_extra_bytes).record_data()
    if _items(found) != _items(expected):
        raise FileFormatError(path, f"has compressed points that do not fit its point format {form.id}.")


def _items(record: bytes) -> tuple[bytes, list[tuple[int, int]]]:
    """Return the number of parts of a point, and each one's type and size, without its compression's version."""
    return record[32:34], [(kind, size) for kind, size, _ in struct.iter_unpack("<HHH", record[34:])]


def _check_chunks(path: Path, file: BinaryIO, start: int, size: int) -> None:
    """Check the number of chunks, of which each holds one whole point at least."""
    table = _number(file, start)
    if table <= start:  # written as a stream, the file tells at its end
        table = _number(file, _size(file) - 8)
    # a version, then the number, four bytes each
    n_chunks = (_number(file, table) >> 32) & 0xFFFFFFFF if start < table <= _size(file) - 8 else -1
    if not 0 <= n_chunks * size <= _size(file):
        raise FileFormatError(path, "is truncated or damaged: its table of chunks is not where it should be.")


def _number(file: BinaryIO, at: int) -> int:
    """Return the signed 8-byte number at an offset."""
    file.seek(at)
    raw = file.read(8)
    return int(struct.unpack("<q", raw)[0]) if len(raw) == 8 else -1


def _size(file: BinaryIO) -> int:
    return os.fstat(file.fileno()).st_size
