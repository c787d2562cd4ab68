"""What tests of pictures share: a view, colours, and where points are in a frame."""

import numpy as np
from numpy.typing import NDArray

from semgp.picture import (
    View,
    splat,
)

RED, BLUE = (200, 30, 40), (30, 60, 210)


AHEAD = View.look_at((0, 0, 0), (1, 0, 0), width=80, height=60)  # along x, z up


def paint(*colours: tuple[int, int, int]) -> NDArray[np.uint8]:
    return np.array(colours, dtype=np.uint8)


def plain(
    points: object, colours: NDArray[np.uint8], size: object = 0.05, view: View = AHEAD
) -> NDArray[np.uint8]:
    return splat(points, colours, view, size, shading=0)  # type: ignore[arg-type]


def wall(x: float, spacing: float = 0.02, half: float = 1.0) -> NDArray[np.float64]:
    """Return a square grid of points across the direction of view."""
    y, z = np.meshgrid(*[np.arange(-half, half, spacing)] * 2)
    return np.column_stack([np.full(y.size, x), y.ravel(), z.ravel()])


def in_frame(view: View, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    x, y, z = view.to_camera(points).T
    return np.asarray(
        (z > 0) & (np.abs(x / z) * view.focal < view.width / 2) & (np.abs(y / z) * view.focal < view.height / 2)
    )
