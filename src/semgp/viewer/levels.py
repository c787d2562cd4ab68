"""The resolutions of a page: a map asked at several, all of which fit its size."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.maps.protocol import SemanticMap
from semgp.viewer.sample import Progress, Sample, ask
from semgp.viewer.surface import Surface

LEVELS = 3
"""Resolutions in a page, each half as fine as the one before."""

Level = tuple[NDArray[np.float64], float]
"""Points (M, 3), and how far apart they are, both in metres."""


def levels(surface: Surface, resolution: float | None, room: int) -> list[Level]:
    """Return the points of each level, finest first, as many as there is room for.

    Raises
    ------
    InputError
        Hardly any room, or too little for a resolution that is asked for.
    """
    finest = surface.spacing / 2 if resolution is None else resolution
    if room < LEVELS:
        raise InputError("a page with so few bytes has no room for points: allow more bytes.")
    while True:
        found = [surface.points(finest * 2**level, room) for level in range(LEVELS)]
        total = sum(len(points) for points, _ in found)
        if total <= room and found[0][1] == finest:
            return found
        if resolution is not None:
            raise InputError(
                f"a page with points every {finest:g} m does not fit its size, which has room for "
                f"{room:,} points: allow more bytes or a coarser resolution."
            )
        finest = max(found[0][1], 1.1 * finest)


def ask_all(
    semantic_map: SemanticMap,
    surface: Surface,
    at: Sequence[Level],
    progress: Progress | None,
) -> list[Sample]:
    """Return a map's samples of levels; progress is that of all together."""
    total, samples, before = sum(len(points) for points, _ in at), [], 0
    for points, resolution in at:

        def report(n: int, _: int, before: int = before) -> None:
            if progress is not None:
                progress(before + n, total)

        samples.append(ask(semantic_map, surface, points, resolution, report))
        before += len(points)
    return samples
