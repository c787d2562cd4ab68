"""Light in the room: one lamp below the ceiling that throws shadows, and light from all around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semgp.scene.raycast import Solids, cast

_LAMP = np.array([0.4, -0.3, 2.5])
_OFF_SURFACE = 1e-4


def shade(
    solids: Solids, points: NDArray[np.float64], normals: NDArray[np.float64], paint: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Return the colour of surface points in the room's light.

    Parameters
    ----------
    solids : Solids
        The scene, which throws shadows.
    points, normals : (N, 3) array
        Surface points in metres, and their unit normals.
    paint : (N, 3) uint8 array
        Colour of the surface itself.
    """
    to_lamp = _LAMP - points
    distance = np.linalg.norm(to_lamp, axis=1)
    facing = np.maximum((to_lamp * normals).sum(axis=1) / distance, 0)
    lit = cast(solids, points + _OFF_SURFACE * normals, to_lamp).distance >= 1
    ambient = 0.58 - 0.12 * normals[:, 2] + 0.05 * normals[:, 1]
    light = ambient + lit * facing * 0.6 / (1 + (distance / 3.5) ** 2)
    return np.asarray(np.minimum(paint * light[:, None] + 0.5, 255), dtype=np.uint8)
