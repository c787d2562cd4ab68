"""Colours for labels and for numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING, Classes
from semgp.errors import InputError

GREY = (206, 206, 206)
"""Colour of missing labels and of values that are not finite."""

_ANCHORS = {
    "viridis": (
        "440154 481a6c 472f7d 414487 39568c 31688e 2a788e 23888e "
        "1f988b 22a884 35b779 54c568 7ad151 a5db36 d2e21b fde725"
    ),
    "magma": (
        "000004 0b0924 20114b 3b0f70 57157e 721f81 8c2981 a8327d "
        "c43c75 de4968 f1605d fa7f5e fe9f6d febf84 fddea0 fcfdbf"
    ),
}
COLOUR_MAPS = tuple(_ANCHORS)
"""Names of the colour maps: from dark to light in even steps of perceived lightness.

Sixteen anchors each of the maps of S. van der Walt and N. Smith (2015, CC0), with straight lines between.
"""


def by_class(labels: ArrayLike, classes: Classes) -> NDArray[np.uint8]:
    """Return the class colour (..., 3) of each label; `GREY` where it is missing.

    Raises
    ------
    InputError
        Labels that are not whole numbers, or that `classes` does not have.
    """
    label = np.asarray(labels)
    if label.size and (label.dtype.kind not in "iu" or label.min() < MISSING or label.max() >= len(classes)):
        raise InputError(f"labels must be whole numbers from {MISSING} to {len(classes) - 1}.")
    return np.vstack([classes.palette, np.array([GREY], dtype=np.uint8)])[label.astype(np.int64)]


def by_value(
    values: ArrayLike, low: float | None = None, high: float | None = None, colour_map: str = "viridis"
) -> NDArray[np.uint8]:
    """Return a colour (..., 3) for each value; `GREY` where it is not finite.

    Parameters
    ----------
    values : array
        Entropy, confidence, variance ...
    low, high : float, optional
        Values of the first and the last colour, which those beyond share; the least and the greatest finite
        value if left out.
    colour_map : str
        One of `COLOUR_MAPS`.

    Raises
    ------
    InputError
        A colour map that does not exist, or `low` above `high`.
    """
    if colour_map not in _ANCHORS:
        raise InputError(f"there is no colour map {colour_map!r}; there are {', '.join(COLOUR_MAPS)}.")
    value = np.asarray(values, dtype=np.float64)
    finite = np.isfinite(value)
    least, greatest = (value[finite].min(), value[finite].max()) if finite.any() else (0.0, 0.0)
    low, high = float(least if low is None else low), float(greatest if high is None else high)
    if not low <= high:
        raise InputError(f"the low end of a colour map, {low}, must not lie above the high one, {high}.")
    share = np.where(finite, value, low) - low
    share = np.divide(share, high - low, out=np.zeros_like(share), where=high > low)
    anchors = np.array([list(bytes.fromhex(colour)) for colour in _ANCHORS[colour_map].split()])
    steps = np.linspace(0, 1, len(anchors))
    colour = np.stack([np.interp(share, steps, anchors[:, c]) for c in range(3)], axis=-1) + 0.5
    colour[~finite] = GREY
    return colour.astype(np.uint8)
