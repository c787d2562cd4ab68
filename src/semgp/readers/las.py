"""LAS files of the ASPRS, versions 1.0 to 1.4, and compressed ones (LAZ)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.asprs import ASPRS, CLASS_RECORD, FIRST_USER_CODE, codes_of, has_asprs_names, laspy_for
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError
from semgp.readers.fields import cloud_from_fields, listed_classes
from semgp.readers.las_checks import check_points, check_records

BYTES_AT_ONCE = 1 << 26
"""Points are read by so many bytes at a time, for a header may promise more than there are."""

DAMAGE = (
    OSError,
    EOFError,
    ValueError,
    struct.error,
    KeyError,
    IndexError,
    TypeError,
    OverflowError,
    RuntimeError,
)
"""What laspy and lazrs raise on damaged files, besides laspy's own errors."""


def read_las(
    path: str | Path,
    *,
    classes: Classes | None = None,
    features: Sequence[str] = (),
    field: str | None = None,
) -> LabelledCloud:
    """Read a LAS or LAZ file.

    Labels are `classification`: the classes that semgp wrote, or those of the ASPRS (`semgp.asprs.ASPRS`), whose
    codes 0 and 1 (never classified, unclassified) and reserved ones are missing labels. Soft labels and all else
    are as in `cloud_from_fields`. Points marked as withheld are left out. Coordinates are taken to be in metres.

    Parameters
    ----------
    path : str or Path
        The file.
    classes : Classes, optional
        Classes of the labels. In a file that lists none, unless they bear the ASPRS' names, the label is the code
        itself: `Classes.numbered(256)` takes all codes as they are.
    features : sequence of str
        Fields that become the cloud's features, such as `intensity`.
    field : str, optional
        The field that holds the labels, where it is not `classification`: its numbers are the labels.

    Raises
    ------
    MissingExtraError
        Without the extra `las`.
    FileFormatError
        A file that is no LAS file, is damaged or truncated, lacks a field, or has codes that the ASPRS leaves to
        the user when no classes are given.
    """
    path = Path(path)
    columns, class_lines = _read(path)
    listed = listed_classes(path, class_lines)
    if field is None or field.lower() == "classification":
        columns = {name: column for name, column in columns.items() if name.lower() not in ("label", "class")}
        spoken = listed or classes or ASPRS
        if listed is not None or has_asprs_names(spoken):
            columns = columns | {"classification": _labels(path, columns["classification"], spoken)}
        return cloud_from_fields(path, columns, classes or spoken, features)
    return cloud_from_fields(path, columns, classes, features, field)


def _read(path: Path) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Return the fields of the points that are not withheld, and the lines that list the classes."""
    laspy = laspy_for("reading LAS files")
    with path.open("rb") as file:
        check_records(path, file)
        try:
            reader = laspy.LasReader(file, closefd=False, read_evlrs=False, laz_backend=laspy.LazBackend.Lazrs)
            header = reader.header
            check_points(path, file, header)
            step = max(1, BYTES_AT_ONCE // header.point_format.size)
            parts = list(reader.chunk_iterator(step)) or [reader.read_points(0)]
            names = ("x", "y", "z", *(n for n in header.point_format.dimension_names if n not in ("X", "Y", "Z")))
            kept = [_not_withheld(part) for part in parts]
            with np.errstate(over="ignore", invalid="ignore"):  # what is not finite the cloud refuses
                columns = {n: np.concatenate([np.asarray(p[n])[k] for p, k in zip(parts, kept)]) for n in names}
            own = [r.record_data for r in header.vlrs if (r.user_id, r.record_id) == CLASS_RECORD]
            class_lines = b"".join(own).decode().splitlines()
        except FileFormatError:
            raise
        except (laspy.LaspyException, *DAMAGE) as error:
            raise FileFormatError(path, f"is no LAS file, or is damaged: {error}") from error
    if sum(map(len, parts)) != header.point_count:
        raise FileFormatError(path, f"is truncated: {header.point_count} points are declared.")
    return _with_eight_bits(columns), class_lines


def _not_withheld(part: Any) -> NDArray[np.bool_] | slice:
    kept = np.asarray(part["withheld"]) == 0
    return slice(None) if kept.all() else kept  # a slice copies nothing


def _with_eight_bits(columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the columns with colours of 8 bits instead of 16, of which some writers use 8; all black is none."""
    rgb = {name: columns[name] for name in ("red", "green", "blue") if name in columns}
    brightest = max((column.max(initial=0) for column in rgb.values()), default=0)
    if brightest == 0:
        return {name: column for name, column in columns.items() if name not in rgb}
    return columns | {name: column >> 8 if brightest > 255 else column for name, column in rgb.items()}


def _labels(path: Path, codes: NDArray[np.uint8], classes: Classes) -> NDArray[np.int32]:
    """Return the labels that codes mean."""
    label_of = np.full(256, MISSING, dtype=np.int32)
    label_of[list(codes_of(classes))] = np.arange(len(classes))
    labels = label_of[codes]
    foreign = np.unique(codes[(labels == MISSING) & (codes >= FIRST_USER_CODE)])
    if len(foreign):
        raise FileFormatError(
            path,
            f"has points of the classes {', '.join(map(str, foreign))}, which the ASPRS leaves to the user: give "
            "classes that name all codes.",
        )
    return labels
