"""A prediction: what every map answers at query points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import entr

from semgp.classes import MISSING, Classes
from semgp.errors import InputError

UNKNOWN, FREE, OCCUPIED = -1, 0, 1
"""What a place is, see `OccupancyPrediction.state`."""


@dataclass(frozen=True, eq=False)
class OccupancyPrediction:
    """Whether something is there, at M query points.

    Parameters
    ----------
    probability : (M,) float array
        Probability that something is there; where the place is not known, the map's prior.
    known : (M,) bool array
        True where rays have ended near by or passed.

    Raises
    ------
    InputError
        Arrays whose shapes do not agree.
    """

    probability: NDArray[np.floating]
    known: NDArray[np.bool_]

    def __post_init__(self) -> None:
        if self.probability.shape != self.known.shape or self.known.ndim != 1:
            raise InputError(
                f"probability {self.probability.shape} and known {self.known.shape} must have one shape (M,)."
            )

    def __len__(self) -> int:
        return len(self.known)

    @property
    def state(self) -> NDArray[np.int8]:
        """`OCCUPIED` (1) where a known place is so with probability 1/2 or more, `FREE` (0), or `UNKNOWN` (-1)."""
        return np.where(self.known, np.where(self.probability >= 0.5, OCCUPIED, FREE), UNKNOWN).astype(np.int8)

    @property
    def entropy(self) -> NDArray[np.floating]:
        """Entropy (M,) of free or occupied, in nats."""
        return np.asarray(entr(self.probability) + entr(1 - self.probability))


@dataclass(frozen=True, eq=False)
class Prediction:
    """Class probabilities and uncertainty at M query points.

    Parameters
    ----------
    classes : Classes
        The C classes of the columns.
    probability : (M, C) float array
        Class probabilities; each row sums to one, whether observed or not. Rows without data hold the map's
        prior.
    observed : (M,) bool array
        True where the map has data that speak of the point; elsewhere the label is `MISSING`.
    mean, variance : (M, C) float array, optional
        Mean and variance of the method's own belief about each class: of the latent function for a Gaussian
        process, of the class probability for Bayesian kernel inference. None where the method has none.
    occupancy : OccupancyPrediction, optional
        Whether something is there, from maps that keep free space. The class probabilities are then those of what
        is there, if something is: class c is there with probability `occupancy.probability * probability[:, c]`.

    Raises
    ------
    InputError
        Arrays whose shapes do not agree.
    """

    classes: Classes
    probability: NDArray[np.floating]
    observed: NDArray[np.bool_]
    mean: NDArray[np.floating] | None = None
    variance: NDArray[np.floating] | None = None
    occupancy: OccupancyPrediction | None = None

    def __post_init__(self) -> None:
        shape = (len(self.observed), len(self.classes))
        for name in ("probability", "mean", "variance"):
            value = getattr(self, name)
            if value is not None and value.shape != shape:
                raise InputError(f"{name} must have shape {shape}, not {value.shape}.")
        if self.occupancy is not None and len(self.occupancy) != shape[0]:
            raise InputError(f"occupancy must be of {shape[0]} points, not {len(self.occupancy)}.")

    def __len__(self) -> int:
        return len(self.observed)

    @property
    def label(self) -> NDArray[np.int32]:
        """Most probable class (M,); `MISSING` where nothing was observed."""
        return np.where(self.observed, self.probability.argmax(axis=1), MISSING).astype(np.int32)

    @property
    def confidence(self) -> NDArray[np.floating]:
        """Probability (M,) of the most probable class."""
        return np.asarray(self.probability.max(axis=1))

    @property
    def entropy(self) -> NDArray[np.floating]:
        """Entropy (M,) of the class probabilities, in nats."""
        return np.asarray(entr(self.probability).sum(axis=1))
