"""A map asked at points along its surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.classes import MISSING
from semgp.maps.batches import query_in_batches
from semgp.maps.protocol import SemanticMap
from semgp.prediction import Prediction
from semgp.viewer.surface import Surface

F64 = NDArray[np.float64]
Progress = Callable[[int, int], None]
"""Called with how many points have been asked for and of how many; may raise to give up."""


@dataclass(frozen=True, eq=False)
class Sample:
    """What a map says at points along its surface.

    Parameters
    ----------
    points : (M, 3) array
        Metres, world frame.
    normals : (M, 3) array
        Where the surface faces, see `Surface.sides`.
    one_sided : (M,) bool array
        Whether it is seen from that side only.
    prediction : Prediction
        The answers.
    resolution : float
        How far apart the points are, metres.
    """

    points: F64
    normals: F64
    one_sided: NDArray[np.bool_]
    prediction: Prediction
    resolution: float

    def shares(self) -> list[tuple[int, float]]:
        """Return the labels that occur, `MISSING` among them, with their shares of the points, largest first."""
        labels, counts = np.unique(self.prediction.label, return_counts=True)
        order = sorted(range(len(labels)), key=lambda i: (labels[i] == MISSING, -counts[i]))
        return [(int(labels[i]), float(counts[i] / len(self.points))) for i in order]


def take_sample(
    semantic_map: SemanticMap, surface: Surface, resolution: float, most: int, progress: Progress | None = None
) -> Sample:
    """Ask a map along its surface.

    Parameters
    ----------
    semantic_map : SemanticMap
        The map.
    surface : Surface
        Its surface.
    resolution : float
        How far apart the points are to be, metres; more where that would be too many.
    most : int
        The most points.
    progress : callable, optional
        See `Progress`.

    Raises
    ------
    InputError
        A resolution that is not positive.
    """
    points, resolution = surface.points(resolution, most)
    return ask(semantic_map, surface, points, resolution, progress)


def ask(
    semantic_map: SemanticMap, surface: Surface, points: F64, resolution: float, progress: Progress | None = None
) -> Sample:
    """Ask a map at points (M, 3) on its surface that are so many metres apart."""
    normals, one_sided = surface.sides(points)
    return Sample(points, normals, one_sided, query_in_batches(semantic_map, points, progress), resolution)
