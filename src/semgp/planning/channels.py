"""What a noisy sensor tells: mutual information of symmetric channels, in nats."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import entr

from semgp.errors import InputError

F64 = NDArray[np.float64]


def occupancy_information(p: F64, error: float) -> F64:
    """Return what is told of places (n,), occupied with probability p, by a binary symmetric channel.

    H(p (1 - e) + (1 - p) e) - H(e), with H the entropy of free or occupied.
    """
    q = p * (1 - error) + (1 - p) * error
    return np.asarray(entr(q) + entr(1 - q) - entr(error) - entr(1 - error))


def class_information(probability: NDArray[np.floating], error: float) -> F64:
    """Return what is told of the class of things (n,) by a C-ary symmetric channel.

    The label is right with probability 1 - e, and each of the others with e / (C - 1): H(label) minus its entropy
    when the class is known. Probabilities (n, C) sum to one.
    """
    n_others = probability.shape[1] - 1
    if not n_others:
        return np.zeros(len(probability))
    other = error / n_others
    label = other + (1 - error - other) * probability
    return np.asarray(entr(label).sum(axis=1) - entr(1 - error) - n_others * entr(other))


def require_errors(sensor_error: float, label_error: float, n_classes: int) -> None:
    """Check the errors of a sensor: beyond those bounds, channels tell by being wrong.

    Raises
    ------
    InputError
        Errors out of range.
    """
    chance = 1 - 1 / n_classes
    for name, error, most in (("sensor_error", sensor_error, 0.5), ("label_error", label_error, chance)):
        if not (math.isfinite(error) and 0 <= error <= max(most, 0)):
            raise InputError(f"{name} must lie between 0 and {most:.3g}, where it tells nothing, not at {error}.")
