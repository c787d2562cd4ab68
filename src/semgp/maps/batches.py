"""A map asked at many points, batch by batch: bounded memory, and progress to show."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.maps.protocol import BATCH, SemanticMap, query_points
from semgp.parallel import slices
from semgp.prediction import OccupancyPrediction, Prediction


def query_in_batches(
    semantic_map: SemanticMap, points: ArrayLike, progress: Callable[[int, int], None] | None = None
) -> Prediction:
    """Return what `semantic_map.query(points)` does, asked in batches.

    Parameters
    ----------
    semantic_map : SemanticMap
        Any map.
    points : (M, 3) array
        Metres, world frame.
    progress : callable, optional
        Called with the number of points that are done and of all.

    Raises
    ------
    InputError
        Points that cannot be used, or an empty map.
    """
    X = query_points(points)
    parts = []
    for batch in slices(len(X), BATCH) if len(X) else [slice(0)]:
        parts.append(semantic_map.query(X[batch]))
        if progress is not None:
            progress(min(batch.stop, len(X)), len(X))
    return parts[0] if len(parts) == 1 else _joined(parts)


def _joined(parts: list[Prediction]) -> Prediction:
    def column(name: str) -> Any:
        values = [getattr(part, name) for part in parts]
        return None if values[0] is None else np.concatenate(values)

    return Prediction(
        parts[0].classes,
        column("probability"),
        column("observed"),
        column("mean"),
        column("variance"),
        _joined_occupancy([part.occupancy for part in parts if part.occupancy is not None]),
    )


def _joined_occupancy(parts: list[OccupancyPrediction]) -> OccupancyPrediction | None:
    if not parts:
        return None
    probability: NDArray[np.floating] = np.concatenate([part.probability for part in parts])
    return OccupancyPrediction(probability, np.concatenate([part.known for part in parts]))
