"""Write semgp's own npz point files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.writers.atomic import atomic_write


def write_npz(path: str | Path, cloud: LabelledCloud, **arrays: ArrayLike) -> None:
    """Write a cloud with all that it holds as a compressed npz file of the layout that `readers.npz` documents.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists.
    cloud : LabelledCloud
        The cloud.
    **arrays
        Further arrays under their own names, such as `entropy` or `variance`; the reader ignores them.

    Raises
    ------
    InputError
        An array under a name that the layout uses, or one of Python objects.
    """
    parts = {
        "points": cloud.points,
        "names": np.array(cloud.classes.names),
        "palette": cloud.classes.palette,
        "labels": cloud.labels,
        "weights": cloud.weights,
        "colours": cloud.colours,
        "features": cloud.features,
        "feature_names": np.array(cloud.feature_names) if cloud.feature_names else None,
        "T_world_sensor": cloud.T_world_sensor,
        "confidence": cloud.confidence,
        "covariances": cloud.covariances,
        "pose_covariance": cloud.pose_covariance,
        "stamp": cloud.stamp,
        "pixels": cloud.pixels,
        "image_shape": cloud.image_shape,
        "up": cloud.up,
    }
    further = {name: np.asarray(a) for name, a in arrays.items()}
    if taken := sorted(parts.keys() & further.keys()):
        raise InputError(f"{', '.join(taken)} of the file are the cloud's: put them into the cloud.")
    if objects := sorted(name for name, a in further.items() if a.dtype.hasobject):
        raise InputError(f"{', '.join(objects)} must be an array of numbers or texts, not of Python objects.")
    present = {name: np.asarray(part) for name, part in parts.items() if part is not None}
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **present, **further)
