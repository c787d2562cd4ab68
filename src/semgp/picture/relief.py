"""Light for a picture of points, from its depth alone: lit slopes and dark edges."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.parallel import n_workers, parallel_map, slices
from semgp.picture.view import View

_LAMP = np.array([-0.35, -0.55, -0.76])
"""Direction to the lamp in the camera's frame: over the left shoulder."""
_RING = np.array([(0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)])

_WINDOW = 4
"""Pixels to each side over which depth is smoothed."""
_SAME_SURFACE = 0.02
"""Depths that differ by less than this share belong to one surface."""
_SLOPE_REACH = 2
"""Pixels over which a slope is measured."""
_EDGES, _DEAD_ZONE, _STEP = 25.0, 0.006, 0.1
"""Darkness of edges; the share of the depth by which a step must exceed the noise; the largest that counts."""


def light_up(
    image: NDArray[np.uint8], depth: NDArray[np.float32], view: View, strength: float, oversampling: int
) -> NDArray[np.uint8]:
    """Return the picture, shaded and averaged down from its oversampled drawing.

    Two kinds of shading are multiplied: slopes are darker the more they turn away from a lamp, with normals
    from smoothed depth, as raw depth is noisy; and pixels are darker the further they lie behind what
    surrounds them (eye-dome lighting; Boucheny, 2009).

    Parameters
    ----------
    image : (oversampling * height, oversampling * width, 3) uint8 array
        The drawing.
    depth : array of the same size
        Its depth in metres; infinite where nothing is drawn.
    view : View
        Where it was taken from.
    strength : float
        0 for none, 1 for the usual.
    oversampling : int
        Drawn pixels on a side of a pixel of the picture.
    """
    shape = (view.height, view.width)
    coarse = np.ascontiguousarray(depth[::oversampling, ::oversampling])
    across, smooth = np.full(shape, np.inf, dtype=np.float32), np.full(shape, np.inf, dtype=np.float32)
    picture = np.empty((*shape, 3), dtype=np.uint8)
    bands = list(slices(view.height, -(-view.height // (4 * n_workers()))))
    parallel_map(lambda rows: _smooth(coarse, 0, 1, rows.start, rows.stop, across), bands)
    parallel_map(lambda rows: _smooth(across, 1, 0, rows.start, rows.stop, smooth), bands)

    def light(rows: slice) -> None:
        _light(image, depth, smooth, view.focal, strength, oversampling, rows.start, rows.stop, picture)

    parallel_map(light, bands)
    return picture


@njit(cache=True, nogil=True)
def _smooth(depth, down, right, first, last, out):  # type: ignore[no-untyped-def]
    """Average the depth along one direction over the neighbours on the same surface."""
    height, width = depth.shape
    for v in range(first, last):
        for u in range(width):
            z = depth[v, u]
            if z == np.inf:
                continue
            total, n = 0.0, 0
            for k in range(-_WINDOW, _WINDOW + 1):
                row, column = v + k * down, u + k * right
                if 0 <= row < height and 0 <= column < width:
                    d = depth[row, column]
                    if abs(d - z) < _SAME_SURFACE * z:
                        total += d
                        n += 1
            out[v, u] = total / n


@njit(cache=True, nogil=True)
def _light(image, depth, smooth, focal, strength, oversampling, first, last, picture):  # type: ignore[no-untyped-def]
    """Shade and average down some rows of the picture."""
    n = oversampling * oversampling
    for v in range(first, last):
        for u in range(picture.shape[1]):
            slope = _slope_light(smooth, v, u, focal) ** strength if smooth[v, u] < np.inf else 1.0
            red = green = blue = 0.5 * n
            for k in range(n):
                y, x = v * oversampling + k // oversampling, u * oversampling + k % oversampling
                light = 1.0
                if depth[y, x] < np.inf:
                    behind = _depth_behind(depth, y, x, oversampling)
                    light = slope * np.exp(-_EDGES * strength * behind) if behind > 0.0 else slope
                red += light * image[y, x, 0]
                green += light * image[y, x, 1]
                blue += light * image[y, x, 2]
            picture[v, u] = np.uint8(red / n), np.uint8(green / n), np.uint8(blue / n)


@njit(cache=True, nogil=True)
def _slope_light(depth, v, u, focal):  # type: ignore[no-untyped-def]
    """Return the light on a pixel's surface: 1 towards the lamp, less away from it."""
    nx = _slope(depth, v, u, 0, _SLOPE_REACH) * focal / depth[v, u]
    ny = _slope(depth, v, u, _SLOPE_REACH, 0) * focal / depth[v, u]
    facing = (nx * _LAMP[0] + ny * _LAMP[1] - _LAMP[2]) / np.sqrt(nx * nx + ny * ny + 1.0)
    return 0.72 + 0.28 * max(0.0, facing)


@njit(cache=True, nogil=True)
def _slope(depth, v, u, down, right):  # type: ignore[no-untyped-def]
    """Return the depth's change per pixel in one direction, on the flatter side: not across an edge."""
    height, width = depth.shape
    flattest = np.inf
    for side in (-1, 1):
        row, column = v + side * down, u + side * right
        if 0 <= row < height and 0 <= column < width:
            slope = side * (depth[row, column] - depth[v, u]) / (down + right)
            if abs(slope) < abs(flattest):
                flattest = slope
    return flattest if abs(flattest) < np.inf else 0.0


@njit(cache=True, nogil=True)
def _depth_behind(depth, y, x, oversampling):  # type: ignore[no-untyped-def]
    """Return how far a drawn pixel lies behind those around it, as a share of its depth."""
    height, width = depth.shape
    behind, scale = 0.0, 1.0 / depth[y, x]
    for reach in (1, 3):
        for k in range(len(_RING)):
            row = y + reach * oversampling * _RING[k, 0]
            column = x + reach * oversampling * _RING[k, 1]
            if 0 <= row < height and 0 <= column < width:
                step = 1.0 - depth[row, column] * scale - _DEAD_ZONE
                if step > 0.0:
                    behind += min(step, _STEP) / reach
    return behind / len(_RING)
