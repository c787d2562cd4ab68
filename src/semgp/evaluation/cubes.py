"""Voxels as what they are: solid cubes, drawn back to front."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw

from semgp.errors import InputError
from semgp.picture import WHITE, View
from semgp.picture.image import Colour, Picture

_OVERSAMPLING = 2
_NEAREST = 0.02
"""Cubes with a corner nearer to the eye than this, in metres, are not drawn."""
_LAMP = np.array([-0.35, -0.55, -0.76])
"""Direction to the lamp in the camera's frame: over the left shoulder."""
_DARKEST, _EDGE = 0.6, 0.82
"""Brightness of a side that the lamp grazes; of the lines around a side, against the side."""
_OUTLINED = 12
"""Sides of fewer drawn pixels from edge to edge get no lines: they would be nothing else."""
_SQUARE = np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)])


def draw_cubes(
    centres: ArrayLike, edge: float, colours: ArrayLike, view: View, background: Colour = WHITE
) -> Picture:
    """Return a picture of voxels of one size, all of one grid.

    Parameters
    ----------
    centres : (L, 3) array
        Centres of the voxels in metres, world frame, whole edges apart.
    edge : float
        Edge of the voxels in metres.
    colours : (L, 3) uint8 array
        Red, green, blue.
    view : View
        Where the picture is taken from.
    background : (red, green, blue), optional
        Colour where there is nothing.

    Raises
    ------
    InputError
        Centres that are not finite, an edge that is not positive, or shapes that do not fit.
    """
    P, C = np.asarray(centres, dtype=np.float64), np.asarray(colours)
    if P.ndim != 2 or P.shape[1] != 3 or not np.isfinite(P).all():
        raise InputError(f"centres must be finite and of shape (L, 3); these have shape {P.shape}.")
    if C.shape != P.shape or C.dtype != np.uint8:
        raise InputError(f"colours must be uint8 of shape {P.shape}, not {C.dtype} of shape {C.shape}.")
    if not edge > 0:
        raise InputError(f"the edge of a voxel must be positive, not {edge}.")
    size = (_OVERSAMPLING * view.width, _OVERSAMPLING * view.height)
    page = Image.new("RGB", size, background)
    draw = ImageDraw.Draw(page)
    cube, side, away = _visible_sides(P, edge, view.T_world_camera[:3, 3])
    corners, drawn = _projected(_corners(P[cube], edge, side, away), view)
    light = _DARKEST + (1 - _DARKEST) * np.maximum(0, away * (view.T_world_camera[:3, :3] @ _LAMP)[side])
    fill = (C[cube] * light[:, None])[drawn]
    span = np.ptp(corners, axis=1).max(axis=1)
    line = np.where(span < _OUTLINED, 1, _EDGE)[:, None] * fill
    for polygon, inside, around in zip(corners.reshape(-1, 8).tolist(), _inks(fill), _inks(line)):
        draw.polygon(polygon, fill=inside, outline=around)
    return np.asarray(page.resize((view.width, view.height), Image.Resampling.BOX))


def _visible_sides(
    P: NDArray[np.float64], edge: float, eye: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.int64]]:
    """Return cube, axis and direction, 1 or -1, of the sides that the eye can see, far to near.

    In a grid, a cube can hide another only if it is at least as near to the eye along every axis: their order by
    the sum over the axes is right wherever the eye is.
    """
    cell = np.rint((P - P.min(axis=0, initial=np.inf)) / edge).astype(np.int64)
    code = _codes(cell)
    taken = np.sort(code)
    offset = (eye - P) / edge
    towards = np.where(offset > 0, 1, -1)
    open_to_eye = np.abs(offset) > 0.5
    for k in range(3):
        step = np.zeros((len(P), 3), dtype=np.int64)
        step[:, k] = towards[:, k]
        neighbour = _codes(cell + step)
        at = np.searchsorted(taken, neighbour)
        open_to_eye[:, k] &= taken[np.minimum(at, len(taken) - 1)] != neighbour
    far_first = np.argsort(-np.rint(np.abs(offset)).sum(axis=1), kind="stable")
    rank, axis = np.nonzero(open_to_eye[far_first])
    cube = far_first[rank]
    return cube, axis, towards[cube, axis]


def _codes(cell: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return one number a cell, from its three that begin at -1."""
    return np.asarray(((cell + 1) << np.array([42, 21, 0])).sum(axis=1))


def _corners(
    P: NDArray[np.float64], edge: float, axis: NDArray[np.intp], away: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the four corners (S, 4, 3) of sides, one after the other around each."""
    corner = np.empty((len(P), 4, 3))
    rows = np.arange(len(P))
    corner[rows, :, axis] = away[:, None]
    corner[rows, :, (axis + 1) % 3] = _SQUARE[:, 0]
    corner[rows, :, (axis + 2) % 3] = _SQUARE[:, 1]
    return P[:, None] + edge / 2 * corner


def _projected(corners: NDArray[np.float64], view: View) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the drawn pixels (K, 4, 2) of the sides that lie before the eye, and which (S,) those are."""
    x, y, z = np.moveaxis(view.to_camera(corners), -1, 0)
    drawn = np.asarray((z > _NEAREST).all(axis=1))
    x, y, z = x[drawn], y[drawn], z[drawn]
    width, height, focal = (_OVERSAMPLING * v for v in (view.width, view.height, view.focal))
    return np.stack([(width - 1) / 2 + focal * x / z, (height - 1) / 2 + focal * y / z], axis=-1), drawn


def _inks(colours: NDArray[np.float64]) -> list[tuple[int, ...]]:
    """Return colours as what pillow draws with."""
    return [tuple(ink) for ink in np.rint(colours).astype(int).tolist()]
