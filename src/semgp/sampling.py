"""Which points of a cloud to keep: on a pixel grid, at random, or as many of each class."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.errors import InputError


def grid_stride(cloud: LabelledCloud, stride: int) -> NDArray[np.bool_]:
    """Return the mask (N,) of the points on every `stride`-th image row and column, from row and column 0.

    With stride 3 this is the "downsampling by one-third" of Ghaffari Jadidi et al. (2017).

    Raises
    ------
    InputError
        A cloud that does not come from an image, or a stride below one.
    """
    if cloud.pixels is None:
        raise InputError("the cloud has no pixels: a grid stride needs points that come from an image.")
    if stride < 1:
        raise InputError(f"the stride must be at least 1, not {stride}.")
    return np.asarray((cloud.pixels % stride == 0).all(axis=1))


def random_subset(cloud: LabelledCloud, n: int, seed: int) -> NDArray[np.intp]:
    """Return the indices, ascending, of `n` points drawn without replacement; of all where there are fewer.

    Raises
    ------
    InputError
        A negative number of points.
    """
    _require_count(n)
    return _draw(np.arange(len(cloud)), n, np.random.default_rng(seed))


def class_balanced(cloud: LabelledCloud, n: int, seed: int) -> NDArray[np.intp]:
    """Return the indices, ascending, of `n` labelled points in equal shares for the classes present.

    A class with fewer points than its share gives all it has, and the others share what it leaves. Where the
    cloud has no more than `n` labelled points, all of them are returned. Soft labels count as their class of
    most weight.

    Raises
    ------
    InputError
        A negative number of points.
    """
    _require_count(n)
    rng = np.random.default_rng(seed)
    labels = cloud.hard_labels
    present, counts = np.unique(labels[labels != MISSING], return_counts=True)
    drawn = [np.empty(0, dtype=np.intp)]
    left = n
    rarest_first = np.argsort(counts, kind="stable")
    for i, c in enumerate(rarest_first):
        share = left // (len(present) - i)
        members = _draw(np.flatnonzero(labels == present[c]), share, rng)
        drawn.append(members)
        left -= len(members)
    return np.sort(np.concatenate(drawn))


def without_labels(cloud: LabelledCloud, keep_mask: ArrayLike) -> LabelledCloud:
    """Return the cloud with the labels, hard or soft, set missing outside a mask: all points, sparse labels.

    Parameters
    ----------
    cloud : LabelledCloud
        The cloud; it is not changed.
    keep_mask : (N,) bool array
        True where the label stays.

    Raises
    ------
    InputError
        A mask that does not fit the points.
    """
    keep = np.asarray(keep_mask)
    if keep.dtype != bool or keep.shape != (len(cloud),):
        raise InputError(
            f"keep_mask must be a bool array of shape ({len(cloud)},), not {keep.dtype} {keep.shape}."
        )
    return replace(
        cloud,
        labels=None if cloud.labels is None else np.where(keep, cloud.labels, MISSING),
        weights=None if cloud.weights is None else np.where(keep[:, None], cloud.weights, 0),
    )


def _draw(indices: NDArray[np.intp], n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return at most n of the indices, ascending."""
    return np.sort(rng.choice(indices, size=min(n, len(indices)), replace=False))


def _require_count(n: int) -> None:
    if n < 0:
        raise InputError(f"the number of points must not be negative, but is {n}.")
