"""Point splatting: a picture of coloured points, without display or GPU."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from semgp.errors import InputError
from semgp.parallel import n_workers, parallel_map, slices
from semgp.picture.relief import light_up
from semgp.picture.view import View

WHITE, DARK = (255, 255, 255), (24, 26, 30)

_OVERSAMPLING = 2
_NEAREST = 0.02
"""Points nearer than this to the eye, in metres, are not drawn."""
_PINHOLE = 4
"""Drawn pixels from side to side of half a gap that is filled."""
_SMALLEST = 1e-4
"""Smallest radius of a disc, in metres, where many points share one place."""
_LARGEST = 0.1
"""Largest radius of a disc, in picture heights: points right before the eye must not hide everything."""


def splat(
    points: ArrayLike,
    colours: ArrayLike,
    view: View,
    size: ArrayLike | None = None,
    *,
    background: tuple[int, int, int] = WHITE,
    shading: float = 1.0,
) -> NDArray[np.uint8]:
    """Return a picture of points as discs that face the eye; near points hide far ones.

    Parameters
    ----------
    points : (N, 3) array
        Positions in metres, world frame.
    colours : (N, 3) uint8 array
        Red, green, blue.
    view : View
        Where the picture is taken from.
    size : float or (N,) array, optional
        Radius of the discs in metres. Left out, that of `disc_sizes`, which makes surfaces look closed; give
        it where several pictures show the same points, because finding it takes as long as drawing.
    background : (red, green, blue)
        Colour where there is nothing; `WHITE` and `DARK` are at hand.
    shading : float
        Strength of the shading that makes shapes and edges visible; 0 leaves the colours as they are.

    Returns
    -------
    (height, width, 3) uint8 array

    Raises
    ------
    InputError
        Points that are not finite, sizes that are not positive, or shapes that do not fit each other.
    """
    P, C = _finite_points(points), np.asarray(colours)
    if C.shape != P.shape or C.dtype != np.uint8:
        raise InputError(f"colours must be uint8 of shape {P.shape}, not {C.dtype} of shape {C.shape}.")
    radius = disc_sizes(P) if size is None else np.asarray(size, dtype=np.float64)
    if radius.shape not in ((), (len(P),)) or not (np.isfinite(radius) & (radius > 0)).all():
        raise InputError("size is one radius in metres, above zero, for all points or for each.")
    if not (np.isfinite(shading) and shading >= 0):
        raise InputError(f"shading must not be negative, nor {shading}.")

    height, width = _OVERSAMPLING * view.height, _OVERSAMPLING * view.width
    depth = np.full((height, width), np.inf, dtype=np.float32)
    image = np.empty((height, width, 3), dtype=np.uint8)
    image[:] = background
    disc, drawn = _project(P, np.broadcast_to(radius, len(P)), view)
    paint = C[drawn]
    bands = list(slices(height, -(-height // (2 * n_workers()))))
    parallel_map(lambda rows: _draw(disc, paint, rows.start, rows.stop, depth, image), bands)
    for hole, beside in parallel_map(lambda rows: _pinholes(depth, rows.start, rows.stop), bands):
        depth[tuple(hole)], image[tuple(hole)] = depth[tuple(beside)], image[tuple(beside)]
    return light_up(image, depth, view, shading, _OVERSAMPLING)


def disc_sizes(points: ArrayLike) -> NDArray[np.float64]:
    """Return a disc radius (N,) in metres for each point, 0.6 of the distance to its eighth neighbour.

    On a square grid of points that is 0.85 of its spacing, where 0.71 closes the surface. Stray points get
    small discs all the same: the median of that and of what their fourth and eighth neighbours have, and at most
    three times what is usual in the cloud.

    Raises
    ------
    InputError
        Points that are not finite, or not of shape (N, 3).
    """
    P = _finite_points(points)
    if len(P) < 2:
        return np.full(len(P), 100 * _SMALLEST)
    k = [min(5, len(P)), min(9, len(P))]  # counted from the point itself
    distance, neighbour = cKDTree(P).query(P, k=k, workers=n_workers())
    radius = 0.6 * distance[:, 1]
    shared = np.median(np.column_stack([radius, radius[neighbour]]), axis=1)
    return np.asarray(np.clip(shared, _SMALLEST, max(3 * np.median(shared), _SMALLEST)))


def _finite_points(points: ArrayLike) -> NDArray[np.float64]:
    P = np.asarray(points, dtype=np.float64)
    if P.ndim != 2 or P.shape[1] != 3 or not np.isfinite(P).all():
        raise InputError(f"points must be finite and of shape (N, 3); these have shape {P.shape}.")
    return P


def _project(
    points: NDArray[np.float64], radius: NDArray[np.float64], view: View
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return column, row, depth, radius in pixels and in metres of the discs before the eye, and which."""
    x, y, z = view.to_camera(points).T
    drawn = np.flatnonzero(z > _NEAREST)
    x, y, z, radius = x[drawn], y[drawn], z[drawn], radius[drawn]
    width, height, focal = (_OVERSAMPLING * v for v in (view.width, view.height, view.focal))
    column, row = (width - 1) / 2 + focal * x / z, (height - 1) / 2 + focal * y / z
    return np.column_stack([column, row, z, np.minimum(focal * radius / z, _LARGEST * height), radius]), drawn


@njit(cache=True, nogil=True)
def _draw(disc, colours, first, last, depth, image):  # type: ignore[no-untyped-def]
    """Draw the rows from `first` to `last` of all discs.

    A disc recedes towards its rim, so that two that overlap meet half-way between their centres.
    """
    width = depth.shape[1]
    for i in range(len(disc)):
        x, y, z, r, recession = disc[i]
        r = max(r, 0.75)  # no disc slips through between the pixels' centres
        if y + r < first or y - r >= last or x + r < 0.0 or x - r >= width:
            continue
        for v in range(max(first, int(np.ceil(y - r))), min(last, int(np.floor(y + r)) + 1)):
            for u in range(max(0, int(np.ceil(x - r))), min(width, int(np.floor(x + r)) + 1)):
                rr = ((u - x) ** 2 + (v - y) ** 2) / (r * r)
                d = np.float32(z + recession * rr)
                if rr <= 1.0 and d < depth[v, u]:
                    depth[v, u] = d
                    image[v, u] = colours[i]


@njit(cache=True, nogil=True)
def _pinholes(depth, first, last):  # type: ignore[no-untyped-def]
    """Return the empty pixels of some rows with drawn ones close by on all four sides, and the nearest of those.

    Both are rows and columns, shape (2, n).
    """
    height, width = depth.shape
    empty = np.count_nonzero(np.isinf(depth[first:last]))
    hole, beside, n = np.empty((2, empty), np.int64), np.empty((2, empty), np.int64), 0
    for v in range(first, last):
        for u in range(width):
            if depth[v, u] < np.inf:
                continue
            sides, nearest = 0, _PINHOLE + 1
            for dv, du in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                for k in range(1, _PINHOLE + 1):
                    y, x = v + k * dv, u + k * du
                    if not (0 <= y < height and 0 <= x < width):
                        break
                    if depth[y, x] < np.inf:
                        sides += 1
                        if k < nearest:
                            nearest, beside[0, n], beside[1, n] = k, y, x
                        break
                if sides == 0:
                    break
            if sides == 4:
                hole[0, n], hole[1, n] = v, u
                n += 1
    return hole[:, :n], beside[:, :n]
