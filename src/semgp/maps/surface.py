"""Query points along the mapped surface, at any resolution."""

import math

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.maps.abilities import resolution_of
from semgp.maps.protocol import SemanticMap
from semgp.picture.coverage import surface_points
from semgp.voxels import voxel_centres, voxel_keys, voxel_origin


def surface_of(semantic_map: SemanticMap, resolution: float | None = None) -> NDArray[np.float64]:
    """Return points (M, 3) along a map's surface, so many metres apart; its own resolution if left out.

    Where they are to be closer than the map's data, they lie on the planes through neighbouring data.

    Raises
    ------
    InputError
        An empty map, or a resolution that is not positive or that the map has not.
    """
    own = resolution_of(semantic_map)
    if resolution is None:
        if own is None:
            raise InputError("this map has no resolution of its own: give one, in metres.")
        resolution = own
    positions = semantic_map.positions
    if own is None or not len(positions) or not 0 < resolution < own:
        return surface_grid(positions, resolution)
    return surface_points(positions, resolution)


def surface_grid(positions: NDArray[np.float64], resolution: float | None) -> NDArray[np.float64]:
    """Return the centres (M, 3) of the voxels that hold data, so many metres apart.

    Parameters
    ----------
    positions : (n, 3) array
        Where the map has data.
    resolution : float
        Edge of a voxel in metres. Below the spacing of the data there is one query point a datum.

    Raises
    ------
    InputError
        No positions, or a resolution that is not positive.
    """
    if resolution is None or not (math.isfinite(resolution) and resolution > 0):
        raise InputError(f"the resolution must be a positive number of metres, not {resolution}.")
    if not len(positions):
        raise InputError("the map is empty: build it from scans with labels.")
    origin = voxel_origin(positions, resolution)
    keys = np.unique(voxel_keys(positions, resolution, origin))
    return voxel_centres(keys, resolution, origin)
