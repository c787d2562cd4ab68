"""A sample as few bytes: what a self-contained page embeds."""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.prediction import Prediction
from semgp.viewer.fields import field_scale, field_values
from semgp.viewer.sample import Sample

TOP = 5
"""The most probable classes of each point, which are embedded with their probabilities; the rest is one sum."""

_STEPS = (1 << 16) - 1
_BYTE = 255


def bytes_per_point(prediction: Prediction) -> int:
    """Return how many bytes a point takes before compression."""
    label = _label_type(len(prediction.classes)).itemsize
    top = min(TOP, len(prediction.classes))
    values = 1 + (prediction.variance is not None) + (prediction.occupancy is not None)
    return 6 + 3 + 1 + label + top * (label + 1) + values


def packed(sample: Sample) -> dict[str, Any]:
    """Return a sample ready for JSON: a header, and its columns deflated, as base64.

    Coordinates are 16-bit steps of the box around the points, a hundred-thousandth of its edge; probabilities and
    values are 8-bit steps of their scale. The label `len(classes)` is `MISSING`.
    """
    prediction = sample.prediction
    C, M = len(prediction.classes), len(sample.points)
    label_type = _label_type(C)
    low, extent = _box(sample.points)
    top = np.argsort(-prediction.probability, axis=1, kind="stable")[:, :TOP]
    label = prediction.label
    columns = {
        "position": np.rint((sample.points - low) / extent * _STEPS).astype("<u2"),
        "label": np.where(label == MISSING, C, label).astype(label_type),
        "top": top.astype(label_type),
        "normal": np.rint(127 * sample.normals).astype(np.int8),
        "oneSided": sample.one_sided.astype(np.uint8),
        "p": np.rint(_BYTE * np.take_along_axis(prediction.probability, top, axis=1)).astype(np.uint8),
    }
    scales = {}
    for name in ("entropy", *(n for n in ("variance", "occupancy") if getattr(prediction, n) is not None)):
        scale = field_scale(prediction, name)
        columns[name] = _bytes_of(field_values(prediction, name), scale.low, scale.high)
        scales[name] = (scale.low, scale.high)
    return {
        "points": M,
        "resolution": sample.resolution,
        "low": low.tolist(),
        "extent": extent.tolist(),
        "scales": scales,
        "columns": _places(columns),
        "data": _deflated(columns),
    }


def _label_type(n_classes: int) -> np.dtype[Any]:
    """Return the type that holds the labels and one for missing.

    Raises
    ------
    InputError
        More classes than two bytes tell apart.
    """
    if n_classes >= 1 << 16:
        raise InputError(f"a page shows at most {_STEPS} classes, not {n_classes}.")
    return np.dtype("u1" if n_classes <= _BYTE else "<u2")


def _box(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the low corner of the box around the points, and its edges; an edge without length counts as 1 m."""
    low = points.min(axis=0)
    extent = points.max(axis=0) - low
    return low, np.where(extent > 0, extent, 1.0)


def _bytes_of(values: NDArray[np.floating], low: float, high: float) -> NDArray[np.uint8]:
    """Return values as 8-bit steps from low to high; what is not finite, which is not observed, as 0."""
    share = (np.where(np.isfinite(values), values, low) - low) / (high - low)
    return np.rint(_BYTE * np.clip(share, 0, 1)).astype(np.uint8)


def _places(columns: Mapping[str, NDArray[Any]]) -> dict[str, dict[str, Any]]:
    """Return type, width and offset in bytes of each column; the offsets suit any type."""
    places, offset = {}, 0
    for name, column in columns.items():
        width = 1 if column.ndim == 1 else column.shape[1]
        places[name] = {"type": column.dtype.str[1:], "width": width, "offset": offset}
        offset += _padded(column.nbytes)
    return places


def _deflated(columns: Mapping[str, NDArray[Any]]) -> str:
    raw = b"".join(column.tobytes().ljust(_padded(column.nbytes), b"\0") for column in columns.values())
    return base64.b64encode(zlib.compress(raw, 9)).decode()


def _padded(n_bytes: int) -> int:
    return math.ceil(n_bytes / 4) * 4
