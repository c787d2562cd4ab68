"""A map's continuous field on a lattice."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import logit

from semgp.maps.protocol import BATCH, SpatialMap, occupancy_of
from semgp.parallel import slices
from semgp.surfaces.lattice import Box, Lattice

F32 = NDArray[np.float32]

Progress = Callable[[int, int], None]
"""Called with the number of bricks done and of all."""

LEAST, MOST = 1e-4, 16.0
"""Log-odds are kept this far from the level and no further than that from it.

On the level itself, vertices of different edges would fall together at a node; probabilities of 0 and 1 have no
finite log-odds, and in single precision none beyond 16.
"""


def lattice_field(
    semantic_map: SpatialMap,
    lattice: Lattice,
    class_: int | None,
    level: float,
    box: Box,
    progress: Progress | None,
) -> F32:
    """Return log-odds of the field minus those of the level on the nodes of B bricks, (B, cells, cells, cells).

    They are positive inside of the surface, and NaN where the map does not know or out of the box. Log-odds cross
    a surface nearly straight, where probabilities bend, so that two nodes tell well where the level is crossed.

    Parameters
    ----------
    semantic_map : SpatialMap
        A map whose predictions have an occupancy.
    lattice : Lattice
        Where to ask.
    class_ : int or None
        The field is the probability that something of this class is there; of anything if None.
    level : float
        Between 0 and 1.
    box : Box
        Nodes outside count as not known.
    progress : callable, optional
        See `Progress`.

    Raises
    ------
    InputError
        A map that does not say whether something is there.
    """
    shape = (lattice.cells,) * 3
    values = np.empty((len(lattice), *shape), dtype=np.float32)
    for part in slices(len(lattice), max(1, BATCH // lattice.cells**3)):
        X = lattice.nodes(part)
        g = _log_odds(semantic_map, X, class_, level)
        g[~box.holds(X)] = np.nan
        values[part] = g.reshape(-1, *shape)
        if progress is not None:
            progress(part.stop, len(lattice))
    return values


def _log_odds(
    semantic_map: SpatialMap, X: NDArray[np.float64], class_: int | None, level: float
) -> NDArray[np.floating]:
    if class_ is None:
        occupancy = semantic_map.occupancy(X)
        p = occupancy.probability.astype(np.float64)
    else:
        prediction = semantic_map.query(X)
        occupancy = occupancy_of(prediction)
        p = occupancy.probability.astype(np.float64) * prediction.probability[:, class_]
    g = np.clip(logit(p) - logit(level), -MOST, MOST)
    g = np.copysign(np.maximum(np.abs(g), LEAST), g)
    g[~occupancy.known] = np.nan
    return np.asarray(g)
