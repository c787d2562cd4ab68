"""What of an iso-surface has been seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from semgp.parallel import n_workers

F64 = NDArray[np.float64]

REACH = 4.0
"""A surface further than this many voxels from where any ray ended is none."""

AHEAD = 5.0
"""Free space is looked for this many voxels ahead of a surface."""


def seen(vertices: F64, normals: F64, occupied: F64, free: F64, voxel: float) -> NDArray[np.bool_]:
    """Return which vertices (V,) a sensor has seen: rays have ended near by, and passed ahead of them.

    Ahead is the ball, `AHEAD` voxels wide, that touches the surface at the vertex from outside. The far side of a
    wall, where the field falls back to the map's prior, has no free space ahead, and neither has the border
    between two classes deep inside of things. What lies between is not looked at: close behind a thin wall, a
    ripple of the field that faces the wall may pass for seen.

    Parameters
    ----------
    vertices, normals : (V, 3) array
        The surface; the normals point outwards.
    occupied, free : (n, 3) array
        Where rays ended, and passed.
    voxel : float
        Metres.
    """
    radius = AHEAD / 2 * voxel
    ended = _distance(vertices, occupied, REACH * voxel)
    passed = _distance(vertices + radius * normals, free, radius)
    return np.asarray(np.isfinite(ended) & np.isfinite(passed))


def _distance(points: F64, to: F64, limit: float) -> F64:
    """Infinite beyond the limit."""
    tree = cKDTree(to, balanced_tree=False, compact_nodes=False)
    return np.asarray(tree.query(points, distance_upper_bound=limit, workers=n_workers())[0])
