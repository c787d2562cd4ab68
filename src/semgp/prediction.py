"""A prediction: what every map answers at query points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.classes import MISSING, Classes
from semgp.errors import InputError


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

    def __post_init__(self) -> None:
        shape = (len(self.observed), len(self.classes))
        for name in ("probability", "mean", "variance"):
            value = getattr(self, name)
            if value is not None and value.shape != shape:
                raise InputError(f"{name} must have shape {shape}, not {value.shape}.")

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
        p = self.probability
        return np.asarray(-np.where(p > 0, p * np.log(np.where(p > 0, p, 1)), 0).sum(axis=1))
