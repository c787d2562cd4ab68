"""Where a round robot can stand among solids, seen from above, and get to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from semgp.scene.raycast import BOX, Solids


def touches(points: NDArray[np.float64], radius: float, solids: Solids) -> NDArray[np.bool_]:
    """Return which points (N, 2) are within a radius of some solid, seen from above, in metres."""
    touched = np.zeros(len(points), dtype=bool)
    for i in _near(solids, points, radius):
        touched[_touched(points, radius, solids, i)] = True
    return touched


def connected(free: NDArray[np.bool_], start: tuple[int, int]) -> NDArray[np.bool_]:
    """Return which free places of a grid (I, J) ways of four neighbours lead to from a free one."""
    part, _ = ndimage.label(free)
    return np.asarray(part == part[start])


def _near(solids: Solids, points: NDArray[np.float64], radius: float) -> NDArray[np.intp]:
    """Return the solids that may be within a radius of some of the points (N, 2), seen from above."""
    if not len(points):
        return np.empty(0, dtype=np.intp)
    reach = radius + np.hypot(*solids.half[:, :2].T)[:, None]
    centre = solids.centre[:, :2]
    within = (centre + reach >= points.min(axis=0)) & (centre - reach <= points.max(axis=0))
    return np.flatnonzero(within.all(axis=1))


def _touched(points: NDArray[np.float64], radius: float, solids: Solids, i: int) -> NDArray[np.intp]:
    """Return which points (N, 2) are within a radius of solid i, seen from above, ellipsoids as discs."""
    half = solids.half[i, :2]
    near = np.flatnonzero((np.abs(points - solids.centre[i, :2]) <= radius + np.hypot(*half)).all(axis=1))
    x, y = (points[near] - solids.centre[i, :2]).T
    if solids.shape[i] != BOX:
        return np.asarray(near[np.hypot(x, y) <= radius + half.max()])
    c, s = np.cos(solids.yaw[i]), np.sin(solids.yaw[i])
    beside = np.maximum(np.abs(np.stack([c * x + s * y, c * y - s * x])) - half[:, None], 0)
    return np.asarray(near[np.hypot(*beside) <= radius])
