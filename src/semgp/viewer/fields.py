"""What a map's points can be coloured by."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.prediction import Prediction

CLASS = "class"
PROBABILITY = "probability of "
"""Field names: "class", "confidence", "entropy", "variance", "occupancy" and "probability of NAME"."""


@dataclass(frozen=True)
class Scale:
    """What the ends of a field's colours stand for."""

    low: float
    high: float
    colour_map: str = "viridis"


def field_names(prediction: Prediction) -> tuple[str, ...]:
    """Return the fields of a map that answers like this."""
    names = [CLASS, "confidence", "entropy"]
    names += ["variance"] if prediction.variance is not None else []
    names += ["occupancy"] if prediction.occupancy is not None else []
    return (*names, *(PROBABILITY + name for name in prediction.classes.names))


def field_called(prediction: Prediction, name: str) -> str:
    """Return the name of a field; that of a class stands for its probability.

    Raises
    ------
    InputError
        The map has no such field.
    """
    names = field_names(prediction)
    if name in names:
        return name
    if name in prediction.classes.names:
        return PROBABILITY + name
    known = ", ".join((*names[: -len(prediction.classes)], *prediction.classes.names))
    raise InputError(f"there is no field {name!r} to colour this map by; there are {known}.")


def field_values(prediction: Prediction, name: str) -> NDArray[np.floating]:
    """Return a field's value (M,) at each point; NaN where the map has not observed any class.

    Raises
    ------
    InputError
        The map has no such field, or it has no numbers ("class").
    """
    name = field_called(prediction, name)
    if name == CLASS:
        raise InputError("the field 'class' has labels, no values: take prediction.label.")
    if name == "occupancy":
        assert prediction.occupancy is not None
        return prediction.occupancy.probability
    if name.startswith(PROBABILITY):
        values = prediction.probability[:, prediction.classes.index(name.removeprefix(PROBABILITY))]
    elif name == "variance":
        assert prediction.variance is not None
        values = prediction.variance[np.arange(len(prediction)), prediction.probability.argmax(axis=1)]
    else:
        values = prediction.confidence if name == "confidence" else prediction.entropy
    return np.where(prediction.observed, values, np.nan)


def field_scale(prediction: Prediction, name: str) -> Scale:
    """Return the ends of a field's colours: fixed ones, but for variance and entropy, which depend on those met.

    Raises
    ------
    InputError
        As `field_values`.
    """
    values = field_values(prediction, name)
    if name == "entropy":
        met = values[np.isfinite(values)]
        return Scale(0.0, max(float(met.max()), 1e-3) if len(met) else math.log(2))
    if name != "variance":
        return Scale(0.0, 1.0)
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    return Scale(low, high if high > low else low + 1.0)
