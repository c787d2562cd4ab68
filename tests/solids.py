"""Solids of synthetic scenes by their definition."""

import numpy as np
from numpy.typing import NDArray

from semgp.scene.furniture import Solid
from semgp.scene.raycast import BOX, ELLIPSOID


def level(solid: Solid, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return below one for points inside a solid, one on its surface, above one outside, by its definition."""
    c, s = np.cos(solid.yaw), np.sin(solid.yaw)
    p = (points - solid.centre) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) / solid.half
    if solid.shape == BOX:
        return np.asarray(np.abs(p).max(axis=1))
    if solid.shape == ELLIPSOID:
        return np.asarray(np.sqrt((p**2).sum(axis=1)))
    return np.asarray(np.maximum(np.hypot(p[:, 0], p[:, 1]), np.abs(p[:, 2])))
