"""Frontiers: where what is known to be free ends and the unknown begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from semgp.maps.protocol import BATCH, SpatialMap
from semgp.maps.settings import require_positive
from semgp.parallel import slices
from semgp.planning.asking import require_occupancy
from semgp.planning.boxes import box_corners, cells_between
from semgp.prediction import FREE, UNKNOWN


@dataclass(frozen=True, eq=False)
class Frontiers:
    """Places at the border of the unknown, in K clusters, the largest first.

    Parameters
    ----------
    points : (n, 3) array
        Centres of the cells, metres, world frame, cluster by cluster.
    cluster : (n,) integer array
        The cluster of each, from 0.
    sizes : (K,) integer array
        Cells of each cluster.
    centres : (K, 3) array
        Means of the clusters' points; of a bent cluster, it need not be free.
    """

    points: NDArray[np.float64]
    cluster: NDArray[np.int64]
    sizes: NDArray[np.int64]
    centres: NDArray[np.float64]


def frontiers(
    semantic_map: SpatialMap, low: ArrayLike, high: ArrayLike, *, resolution: float | None = None
) -> Frontiers:
    """Return the cells of a box that are known to be free and touch an unknown cell of it with one of their faces.

    Frontier cells that touch, if only with a corner, are of one cluster. What lies outside of the box does not
    count as unknown. After Yamauchi (1997), "A frontier-based approach for autonomous exploration".

    Parameters
    ----------
    semantic_map : SpatialMap
        A map that keeps free space; asked at the centre of each cell.
    low, high : (3,) arrays
        Corners of the box, metres, world frame.
    resolution : float, optional
        Edge of a cell in metres; left out, the map's.

    Raises
    ------
    InputError
        Corners that are not finite or not in order, a resolution that is not positive, a box of more than
        16,777,216 cells, or a map that keeps no free space.
    """
    a, b = box_corners(low, high, 3)
    require_occupancy(semantic_map, a)
    edge = semantic_map.resolution if resolution is None else require_positive("resolution", resolution)
    cells = cells_between(a, b, edge)
    states = np.empty(len(cells), dtype=np.int8)
    for part in slices(len(cells), BATCH):
        centres = cells.centres(np.arange(part.start, part.stop))
        states[part] = semantic_map.occupancy(centres).state
    state = states.reshape(cells.shape)
    found, n_clusters = ndimage.label((state == FREE) & _beside(state == UNKNOWN), np.ones((3, 3, 3)))
    flat = np.flatnonzero(found)
    cluster = found.ravel()[flat] - 1
    rank = np.argsort(np.argsort(-np.bincount(cluster, minlength=n_clusters), kind="stable"))
    cluster = rank[cluster]
    order = np.argsort(cluster, kind="stable")
    points, cluster = cells.centres(flat[order]), cluster[order]
    sizes = np.bincount(cluster, minlength=n_clusters)
    sums = [np.bincount(cluster, points[:, axis], n_clusters) for axis in range(3)]
    return Frontiers(points, cluster, sizes, np.stack(sums, axis=1) / sizes[:, None])


def _beside(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells that have one of these cells at one of their six faces."""
    return np.asarray(ndimage.binary_dilation(cells, ndimage.generate_binary_structure(3, 1)) & ~cells)
