"""What a prediction shows: its colours, and the key that explains them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.classes import MISSING, Classes
from semgp.errors import InputError
from semgp.picture.colour import by_class, by_value
from semgp.prediction import Prediction

QUANTITIES = ("class", "confidence", "entropy", "variance")
"""What a prediction can be coloured by, besides the probability of one of its classes, by its name."""

_CLEAR = 0.99
"""The last colour of entropy and variance is reached by all values above this quantile."""


@dataclass(frozen=True)
class Bar:
    """A colour bar's ends and what it shows, see `semgp.picture.colour_bar`."""

    low: float
    high: float
    title: str


@dataclass(frozen=True, eq=False)
class Paint:
    """Colours of M points, and their key.

    Parameters
    ----------
    title : str
        What is shown.
    colours : (M, 3) uint8 array
        Grey where nothing is known.
    key : Classes or Bar or None
        The classes that occur, or the scale of the colours, or nothing for colours as they are.
    missing : str, optional
        What grey means, where it occurs.
    """

    title: str
    colours: NDArray[np.uint8]
    key: Classes | Bar | None = None
    missing: str | None = None


def paint(prediction: Prediction, by: str) -> Paint:
    """Return the colours of a prediction's points.

    Parameters
    ----------
    prediction : Prediction
        Of M points.
    by : str
        One of `QUANTITIES`, or the name of a class for its probability. Variance is that of the most probable
        class.

    Raises
    ------
    InputError
        Neither a quantity nor a class, or the variance of a map that has none.
    """
    if by == "class":
        return paint_labels("class", prediction.label, prediction.classes, "not observed")
    if by == "confidence":
        return paint_values(by, _seen(prediction.confidence, prediction), 0.0, 1.0)
    if by == "entropy":
        return paint_values("entropy (nats)", _seen(prediction.entropy, prediction), 0.0)
    if by == "variance":
        if prediction.variance is None:
            raise InputError("this map has no variance: colour it by entropy or confidence.")
        top = prediction.probability.argmax(axis=1)[:, None]
        return paint_values(by, _seen(np.take_along_axis(prediction.variance, top, axis=1)[:, 0], prediction), 0.0)
    require_colours(prediction.classes, [by])
    probability = prediction.probability[:, prediction.classes.index(by)]
    return paint_values(f"probability of {by}", _seen(probability, prediction), 0.0, 1.0)


def require_colours(classes: Classes, names: Sequence[str]) -> None:
    """Raise InputError for a name that is neither a quantity nor a class."""
    for name in names:
        if name not in (*QUANTITIES, *classes.names):
            known = ", ".join([*QUANTITIES, *classes.names])
            raise InputError(f"a map cannot be coloured by {name!r}; choose from {known}.")


def paint_labels(title: str, labels: NDArray[np.integer], classes: Classes, missing: str) -> Paint:
    """Return the colours of labels (M,); the key has the classes that occur, and what `missing` ones are called.

    Raises
    ------
    InputError
        Labels that `classes` does not have.
    """
    present = [int(c) for c in np.unique(labels)]
    shown = [c for c in present if c != MISSING]
    key = (
        Classes(tuple(classes.names[c] for c in shown), tuple(classes.colours[c] for c in shown))
        if shown
        else None
    )
    return Paint(title, by_class(labels, classes), key, missing if MISSING in present else None)


def paint_values(title: str, values: NDArray[np.floating], low: float, high: float | None = None) -> Paint:
    """Return the colours of values (M,), grey where they are NaN, and their bar.

    Without `high`, the last colour is that of the value which all but a hundredth stay below.
    """
    if high is None:
        known = values[np.isfinite(values)]
        high = _round_up(float(np.quantile(known, _CLEAR))) if len(known) else 1.0
    return Paint(title, by_value(values, low, high), Bar(low, high, title))


def _seen(values: NDArray[np.floating], prediction: Prediction) -> NDArray[np.floating]:
    return np.where(prediction.observed, values, np.nan)


def _round_up(value: float) -> float:
    """Return the next number with two digits, so that a key ends in a readable one."""
    if not value > 0:
        return 1.0
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / digit - 1e-9) * digit:.12g}")
