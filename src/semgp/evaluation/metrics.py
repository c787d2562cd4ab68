"""How often the labels are right: accuracy, precision, recall and intersection over union."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.evaluation.checks import true_labels


def confusion(label: ArrayLike, truth: ArrayLike, n_classes: int) -> NDArray[np.int64]:
    """Count the points (C, C + 1) by true class (row) and given class (column).

    Parameters
    ----------
    label : (N,) integer array
        Labels given; `MISSING`, an answer withheld, goes to the last column.
    truth : (N,) integer array
        True labels; points without one (`MISSING`) are left out.
    n_classes : int
        Number of classes C.

    Raises
    ------
    InputError
        Shapes that do not agree, or labels out of range.
    """
    given = np.asarray(label)
    if given.ndim != 1 or (len(given) and given.dtype.kind not in "iu"):
        raise InputError(f"labels must be whole numbers of shape (N,), not {given.dtype} of {given.shape}.")
    if len(given) and (given.min() < MISSING or given.max() >= n_classes):
        raise InputError(f"labels go from {given.min()} to {given.max()}, not from {MISSING} to {n_classes - 1}.")
    y = true_labels(truth, len(given), n_classes)
    known = y != MISSING
    column = np.where(given == MISSING, n_classes, given)
    flat = np.bincount((y * (n_classes + 1) + column)[known], minlength=n_classes * (n_classes + 1))
    return flat.reshape(n_classes, n_classes + 1)


def accuracy(confusion: NDArray[np.int64]) -> float:
    """Return the share of points whose label is right; NaN without points. An answer withheld is wrong."""
    n = confusion.sum()
    return float(confusion.diagonal().sum() / n) if n else float("nan")


def iou(confusion: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the intersection over union (C,) of each class; NaN for classes absent from the truth.

    An answer withheld misses its true class and is no false alarm for another.
    """
    hit = confusion.diagonal()
    points = confusion.sum(axis=1)
    union = points + confusion[:, :-1].sum(axis=0) - hit
    return _shares(hit, np.where(points > 0, union, 0))


def recall(confusion: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the share (C,) of each class's points whose label is right; NaN for classes absent from the truth."""
    return _shares(confusion.diagonal(), confusion.sum(axis=1))


def precision(confusion: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the share (C,) of the points given each label that have it in truth; NaN for labels not given."""
    return _shares(confusion.diagonal(), confusion[:, :-1].sum(axis=0))


def _shares(part: NDArray[np.int64], whole: NDArray[np.int64]) -> NDArray[np.float64]:
    return np.asarray(np.divide(part, whole, out=np.full(len(part), np.nan), where=whole > 0))
