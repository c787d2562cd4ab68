"""OctoMap's inverse sensor model: what a ray that ends in a voxel, or passes through it, says of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from semgp.errors import InputError


@dataclass(frozen=True)
class SensorModel:
    """Probabilities of the sensor model, with OctoMap's defaults.

    Parameters
    ----------
    hit : float, optional
        Occupancy of a voxel in which one ray ended and of which nothing else is known.
    miss : float, optional
        Occupancy of a voxel through which one ray passed and of which nothing else is known.
    clamp_min, clamp_max : float, optional
        Occupancy never gets surer than this, so that the map can follow a changing world.
    threshold : float, optional
        A known voxel of this occupancy or more is occupied, one of less is free.

    Raises
    ------
    InputError
        Probabilities not in the order 0 < clamp_min <= miss <= 0.5 <= hit <= clamp_max < 1, or a threshold
        that is not between 0 and 1.
    """

    hit: float = 0.7
    miss: float = 0.4
    clamp_min: float = 0.1192
    clamp_max: float = 0.971
    threshold: float = 0.5

    def __post_init__(self) -> None:
        if not 0 < self.clamp_min <= self.miss <= 0.5 <= self.hit <= self.clamp_max < 1:
            raise InputError(
                "the sensor model needs 0 < clamp_min <= miss <= 0.5 <= hit <= clamp_max < 1, not "
                f"{self.clamp_min}, {self.miss}, 0.5, {self.hit}, {self.clamp_max}."
            )
        if not 0 < self.threshold < 1:
            raise InputError(f"the occupancy threshold must lie between 0 and 1, not at {self.threshold}.")

    def occupied(self, values: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return where log-odds mean occupied."""
        return np.asarray(values >= log_odds(self.threshold))


def log_odds(probability: float) -> np.float32:
    """Return the log-odds of a probability, as float32, as OctoMap keeps them."""
    return np.float32(math.log(probability / (1 - probability)))


def probability(values: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the probabilities of log-odds."""
    return np.asarray(expit(values.astype(np.float64)))
