"""Points to look at, and where they are on the screen."""

import numpy as np
from numpy.typing import NDArray

from semgp.picture import View

F64 = NDArray[np.float64]


def box(n: int = 4000, size: tuple[float, float, float] = (4, 2, 1)) -> F64:
    return np.random.default_rng(0).uniform(-0.5, 0.5, (n, 3)) * size + (10, 20, 5)


def on_screen(view: View, points: F64) -> F64:
    """Return columns and rows as shares of the frame, -1 to 1."""
    x, y, z = view.to_camera(points).T
    half = np.tan(np.radians(view.fov) / 2) * z
    return np.column_stack([x / (half * view.width / view.height), y / half])
