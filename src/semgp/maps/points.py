"""What a map says at points, as a point file of any format that semgp writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.asprs import laspy_for
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.picture.colour import by_class
from semgp.prediction import Prediction
from semgp.writers import write_csv, write_las, write_npz, write_pcd, write_ply


class PointWriter(Protocol):
    """Writes points with classes, colours, class probabilities and further fields."""

    def __call__(
        self,
        path: str | Path,
        points: ArrayLike,
        *,
        classes: Classes,
        colours: NDArray[np.uint8],
        probability: NDArray[np.floating],
        **fields: Any,
    ) -> None:
        """Write the file."""
        ...


def _write_npz(
    path: str | Path,
    points: ArrayLike,
    *,
    classes: Classes,
    colours: NDArray[np.uint8],
    probability: NDArray[np.floating],
    **fields: Any,
) -> None:
    confidence = np.minimum(fields.pop("confidence"), 1)  # a sum of rounded numbers may be a little more
    cloud = LabelledCloud(np.asarray(points), classes, weights=probability, colours=colours, confidence=confidence)
    write_npz(path, cloud, **fields)


POINT_WRITERS: dict[str, PointWriter] = {
    ".ply": write_ply,
    ".npz": _write_npz,
    ".pcd": write_pcd,
    ".las": write_las,
    ".laz": write_las,
    ".csv": write_csv,
}
"""What writes a point file, by its suffix."""


def point_writer(path: Path) -> PointWriter:
    """Return what writes a point file of a path's suffix; to be asked before a long query.

    Raises
    ------
    InputError
        Another suffix than those of `POINT_WRITERS`.
    MissingExtraError
        LAS files without the extra `las`.
    """
    suffix = path.suffix.lower()
    if suffix not in POINT_WRITERS:
        raise InputError(f"{path}: points are written as {', '.join(POINT_WRITERS)}.")
    if suffix in (".las", ".laz"):
        laspy_for("writing LAS files")
    return POINT_WRITERS[suffix]


def write_prediction(path: Path, points: NDArray[np.float64], prediction: Prediction) -> None:
    """Write a prediction at points (M, 3) as a point file; its suffix tells the format.

    Fields: label, the class colour, class probabilities, confidence, entropy, observed (0 or 1) and, where the map
    has them, variance (of the most probable class), occupancy and state (1 occupied, 0 free, -1 unknown).

    Raises
    ------
    InputError, MissingExtraError
        As `point_writer`, or what the format cannot hold.
    """
    write, label = point_writer(path), prediction.label
    fields = {
        "label": label,
        "observed": prediction.observed.astype(np.uint8),
        "confidence": prediction.confidence,
        "entropy": prediction.entropy,
    }
    if prediction.variance is not None:
        best = prediction.probability.argmax(axis=1)
        fields["variance"] = np.take_along_axis(prediction.variance, best[:, None], axis=1)[:, 0]
    if prediction.occupancy is not None:
        fields |= {"occupancy": prediction.occupancy.probability, "state": prediction.occupancy.state}
    write(
        path,
        points,
        classes=prediction.classes,
        colours=by_class(label, prediction.classes),
        probability=prediction.probability,
        **fields,
    )
