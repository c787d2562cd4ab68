"""Solids of synthetic scenes by their definition."""

import numpy as np
from numpy.typing import NDArray

from semgp.scene.furniture import Solid
from semgp.scene.raycast import BOX, ELLIPSOID, Solids


def level(solid: Solid, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return below one for points inside a solid, one on its surface, above one outside, by its definition."""
    c, s = np.cos(solid.yaw), np.sin(solid.yaw)
    p = (points - solid.centre) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) / solid.half
    if solid.shape == BOX:
        return np.asarray(np.abs(p).max(axis=1))
    if solid.shape == ELLIPSOID:
        return np.asarray(np.sqrt((p**2).sum(axis=1)))
    return np.asarray(np.maximum(np.hypot(p[:, 0], p[:, 1]), np.abs(p[:, 2])))


def inside(solids: Solids, s: int, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points lie inside a solid, by its definition."""
    c, n = np.cos(solids.yaw[s]), np.sin(solids.yaw[s])
    p = (points - solids.centre[s]) @ np.array([[c, -n, 0], [n, c, 0], [0, 0, 1]]) / solids.half[s]
    if solids.shape[s] == BOX:
        return np.asarray(np.abs(p).max(axis=1) < 1)
    if solids.shape[s] == ELLIPSOID:
        return np.asarray((p**2).sum(axis=1) < 1)
    return np.asarray((np.hypot(p[:, 0], p[:, 1]) < 1) & (np.abs(p[:, 2]) < 1))
