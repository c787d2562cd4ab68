"""Bodies of answers: a prediction as .npz, as raw rows, or as JSON.

The arrays of an .npz answer at M points of C classes; the last four are there where the map has them:

============= ================== ===========================================================================
`names`       (C,) text          class names
`palette`     (C, 3) uint8       class colours
`observed`    (M,) bool          whether the map has data that speak of the point
`probability` (M, C) float32     class probabilities
`mean`        (M, C) float32     of the method's own belief about each class
`variance`    (M, C) float32     of the same; (M, 1) where all classes share it
`occupancy`   (M,) float32       probability that something is there
`known`       (M,) bool          whether rays have ended near by or passed
============= ================== ===========================================================================

Baselines answer in float64. Raw rows are float32 throughout, with the columns that the header `X-Semgp-Columns`
lists as `name:count`, for example `probability:13,variance:1,observed:1`.
"""

from __future__ import annotations

import io
import json
import zipfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.readers.npz import read_npy
from semgp.service.formats import COLUMNS, JSON, NPZ

Arrays = dict[str, NDArray[Any]]


def encode_answer(prediction: Prediction, media: str) -> tuple[bytes, dict[str, str]]:
    """Return a prediction as the body of an answer, `NPZ`, `RAW` or `JSON`, and the headers that describe it."""
    arrays = _arrays(prediction)
    if media == NPZ:
        names = {"names": np.array(prediction.classes.names), "palette": prediction.classes.palette}
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, **names, **arrays)
        return stream.getvalue(), {}
    if media == JSON:
        plain = {"classes": prediction.classes.names, "label": prediction.label.tolist()}
        return json.dumps(plain | {name: a.tolist() for name, a in arrays.items()}).encode(), {}
    columns = {name: a if a.ndim > 1 else a[:, None] for name, a in arrays.items()}
    rows = np.concatenate([a.astype("<f4") for a in columns.values()], axis=1)
    return rows.tobytes(), {COLUMNS: ",".join(f"{name}:{a.shape[1]}" for name, a in columns.items())}


def decode_answer(body: bytes) -> Prediction:
    """Return the prediction in an `NPZ` answer; errors are those of `zipfile` and `read_npy`."""
    with zipfile.ZipFile(io.BytesIO(body)) as archive:
        arrays = {name.removesuffix(".npy"): read_npy(archive.read(name)) for name in archive.namelist()}
    probability = arrays["probability"]
    classes = Classes(tuple(arrays["names"].tolist()), tuple(map(tuple, arrays["palette"].tolist())))
    variance, occupancy = arrays.get("variance"), arrays.get("occupancy")
    return Prediction(
        classes,
        probability,
        arrays["observed"],
        mean=arrays.get("mean"),
        variance=None if variance is None else np.broadcast_to(variance, probability.shape),
        occupancy=None if occupancy is None else OccupancyPrediction(occupancy, arrays["known"]),
    )


def _arrays(prediction: Prediction) -> Arrays:
    """What is known about each point, in the order of the columns of raw rows."""
    arrays: dict[str, NDArray[Any] | None] = {
        "probability": prediction.probability,
        "mean": prediction.mean,
        "variance": None if prediction.variance is None else _once(prediction.variance),
        "observed": prediction.observed,
    }
    if prediction.occupancy is not None:
        arrays |= {"occupancy": prediction.occupancy.probability, "known": prediction.occupancy.known}
    return {name: array for name, array in arrays.items() if array is not None}


def _once(a: NDArray[Any]) -> NDArray[Any]:
    """A column that all classes share, once."""
    return a[:, :1] if a.strides[1] == 0 else a
