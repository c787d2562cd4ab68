"""Asking a map at many points: in batches that bound the memory, and with the occupancy that planners need."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.checks import as_array, require_finite
from semgp.errors import InputError
from semgp.maps.protocol import BATCH, SpatialMap, occupancy_of
from semgp.parallel import slices
from semgp.prediction import OccupancyPrediction, Prediction

LONGEST = 1_000_000
"""Most samples along one ray."""


def require_occupancy(semantic_map: SpatialMap, somewhere: NDArray[np.float64]) -> None:
    """Check, at a point (3,), that a map keeps free space; raises as `occupancy_of`."""
    occupancy_of(semantic_map.query(somewhere[None]))


def answers(semantic_map: SpatialMap, points: NDArray[np.float64]) -> Iterator[tuple[slice, Prediction]]:
    """Yield slices of points (M, 3) and what the map answers there."""
    for part in slices(len(points), BATCH):
        yield part, semantic_map.query(points[part])


def occupancy_at(semantic_map: SpatialMap, points: NDArray[np.float64]) -> OccupancyPrediction:
    """Return whether something is there, at points (M, 3)."""
    probability, known = np.empty(len(points)), np.empty(len(points), dtype=bool)
    for part in slices(len(points), BATCH):
        occupancy = semantic_map.occupancy(points[part])
        probability[part], known[part] = occupancy.probability, occupancy.known
    return OccupancyPrediction(probability, known)


def unit_directions(directions: ArrayLike) -> NDArray[np.float64]:
    """Return directions (R, 3) of length one.

    Raises
    ------
    InputError
        Another shape, NaN, or a direction of length zero.
    """
    d = as_array("directions", directions, np.float64)
    if d.ndim != 2 or d.shape[1] != 3:
        raise InputError(f"directions must have shape (R, 3), not {d.shape}.")
    require_finite("directions", d)
    largest = np.abs(d).max(axis=1, keepdims=True, initial=0)
    if not largest.all():
        raise InputError(f"the direction in row {np.argmin(largest)} is zero: drop it.")
    d = d / largest  # squares of what is left neither overflow nor vanish
    return np.asarray(d / np.linalg.norm(d, axis=1, keepdims=True))


def samples_along(max_range: float, spacing: float) -> int:
    """Return how many pieces of a length cover a range.

    Raises
    ------
    InputError
        More than `LONGEST`.
    """
    if max_range > LONGEST * spacing:
        raise InputError(
            f"a ray of {max_range:g} m has more than {LONGEST:,} samples {spacing:g} m apart: shorten its range."
        )
    return max(1, int(np.ceil(max_range / spacing - 1e-9)))
