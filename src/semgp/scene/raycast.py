"""Exact ray casting against boxes, ellipsoids and cylinders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from semgp.errors import InputError
from semgp.parallel import parallel_map, slices

BOX, ELLIPSOID, CYLINDER = range(3)
"""The shapes: in its own frame, scaled by its half sizes, each fills a part of the cube [-1, 1]^3."""

_RAYS_PER_SLICE = 16_384


@dataclass(frozen=True, eq=False)
class Solids:
    """P opaque solids, upright and turned about the vertical.

    Parameters
    ----------
    shape : (P,) integer array
        `BOX`, `ELLIPSOID` or `CYLINDER` (axis along z).
    centre : (P, 3) array
        Centres in metres, world frame.
    half : (P, 3) array
        Half of the length, width and height in metres: the semi-axes of an ellipsoid, radius, radius and
        half height of a cylinder.
    yaw : (P,) array
        Turn about the world's z axis, in radians, anticlockwise seen from above.
    """

    shape: NDArray[np.int64]
    centre: NDArray[np.float64]
    half: NDArray[np.float64]
    yaw: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.shape)


@dataclass(frozen=True, eq=False)
class Hits:
    """Where N rays first meet a solid.

    Parameters
    ----------
    distance : (N,) array
        Distance in lengths of the ray's direction vector; infinite where nothing is hit.
    solid : (N,) integer array
        Index of the solid hit, -1 where nothing is hit.
    normal : (N, 3) array
        Unit outward normal of the surface hit; zero where nothing is hit.
    """

    distance: NDArray[np.float64]
    solid: NDArray[np.int64]
    normal: NDArray[np.float64]


def cast(solids: Solids, origins: ArrayLike, directions: ArrayLike) -> Hits:
    """Return what each ray meets first.

    Parameters
    ----------
    solids : Solids
        The scene.
    origins : (3,) or (N, 3) array
        Where the rays start, in metres: outside of every solid (a solid is not seen from inside).
    directions : (N, 3) array
        Their directions, of any length but zero.

    Raises
    ------
    InputError
        Shapes that do not fit each other.
    """
    d = np.ascontiguousarray(directions, dtype=np.float64)
    if d.ndim != 2 or d.shape[1] != 3:
        raise InputError(f"directions must have shape (N, 3), not {d.shape}.")
    o = np.asarray(origins, dtype=np.float64)
    if o.shape not in ((3,), d.shape):
        raise InputError(f"origins must have shape (3,) or {d.shape}, not {o.shape}.")
    o = np.broadcast_to(o, d.shape)
    hits = Hits(np.full(len(d), np.inf), np.full(len(d), -1), np.zeros(d.shape))
    turn = np.column_stack([np.cos(solids.yaw), np.sin(solids.yaw)])
    ball = (solids.half**2).sum(axis=1)
    scene = (solids.shape, solids.centre, 1 / solids.half, ball, turn)

    def work(part: slice) -> None:
        _cast(o[part], d[part], *scene, hits.distance[part], hits.solid[part], hits.normal[part])

    parallel_map(work, slices(len(d), _RAYS_PER_SLICE))
    return hits


@njit(cache=True, nogil=True)
def _cast(origins, directions, shape, centre, scale, ball, turn, distance, solid, normal):  # type: ignore[no-untyped-def]
    """Fill `distance`, `solid` and `normal` for each ray."""
    for i in range(len(directions)):
        ox, oy, oz = origins[i]
        dx, dy, dz = directions[i]
        dd = dx * dx + dy * dy + dz * dz
        nearest, which = np.inf, -1
        for s in range(len(shape)):
            x, y, z = ox - centre[s, 0], oy - centre[s, 1], oz - centre[s, 2]
            along, outside = x * dx + y * dy + z * dz, x * x + y * y + z * z - ball[s]
            if outside > 0.0 and (along > 0.0 or outside * dd > along * along):
                continue  # the ray passes by the ball around the solid, as most rays do
            p, w = _to_unit(x, y, z, turn[s], scale[s]), _to_unit(dx, dy, dz, turn[s], scale[s])
            t = _enter_box(p, w) if shape[s] == BOX else _enter_round(p, w, shape[s] == CYLINDER)
            if 0.0 < t < nearest:
                nearest, which = t, s
        distance[i], solid[i] = nearest, which
        if which >= 0:
            c = centre[which]
            x, y, z = ox + nearest * dx - c[0], oy + nearest * dy - c[1], oz + nearest * dz - c[2]
            p = _to_unit(x, y, z, turn[which], scale[which])
            normal[i, 0], normal[i, 1], normal[i, 2] = _normal(p, shape[which], turn[which], scale[which])


@njit(cache=True, nogil=True, inline="always")
def _to_unit(x, y, z, turn, scale):  # type: ignore[no-untyped-def]
    """Turn a vector into a solid's own frame and scale it by one over the half sizes."""
    c, s = turn
    return (c * x + s * y) * scale[0], (c * y - s * x) * scale[1], z * scale[2]


@njit(cache=True, nogil=True)
def _enter_box(p, w):  # type: ignore[no-untyped-def]
    """Return where the ray p + t w enters the cube [-1, 1]^3 (slab method), infinity where it does not."""
    t0, t1 = -np.inf, np.inf
    for k in range(3):
        if w[k] == 0.0:
            if abs(p[k]) > 1.0:
                return np.inf
        else:
            inverse = 1.0 / w[k]
            middle, reach = -p[k] * inverse, abs(inverse)
            t0, t1 = max(t0, middle - reach), min(t1, middle + reach)
    return t0 if t0 <= t1 else np.inf


@njit(cache=True, nogil=True)
def _enter_round(p, w, upright):  # type: ignore[no-untyped-def]
    """Return where the ray enters the unit ball, or the upright unit cylinder; infinity where it does not."""
    a = w[0] * w[0] + w[1] * w[1]
    b = p[0] * w[0] + p[1] * w[1]
    c = p[0] * p[0] + p[1] * p[1] - 1.0
    t0, t1 = -np.inf, np.inf
    if upright:
        if w[2] != 0.0:
            t0, t1 = (-1.0 - p[2]) / w[2], (1.0 - p[2]) / w[2]
            t0, t1 = min(t0, t1), max(t0, t1)
        elif abs(p[2]) > 1.0:
            return np.inf
    else:
        a, b, c = a + w[2] * w[2], b + p[2] * w[2], c + p[2] * p[2]
    if a == 0.0:  # a vertical ray, along the cylinder's axis
        return t0 if c <= 0.0 else np.inf
    root = b * b - a * c
    if root < 0.0:
        return np.inf
    t0, t1 = max(t0, (-b - np.sqrt(root)) / a), min(t1, (-b + np.sqrt(root)) / a)
    return t0 if t0 <= t1 else np.inf


@njit(cache=True, nogil=True)
def _normal(p, shape, turn, scale):  # type: ignore[no-untyped-def]
    """Return the outward unit normal, world frame, at a surface point p of the unit shape."""
    x, y, z = p[0] * scale[0], p[1] * scale[1], p[2] * scale[2]
    if shape == BOX:
        face = max(abs(p[0]), abs(p[1]), abs(p[2]))
        x, y, z = x * (abs(p[0]) == face), y * (abs(p[1]) == face), z * (abs(p[2]) == face)
    elif shape == CYLINDER:
        on_side = abs(p[2]) < np.hypot(p[0], p[1])
        x, y, z = x * on_side, y * on_side, z * (not on_side)
    c, s = turn
    length = np.sqrt(x * x + y * y + z * z)
    return (c * x - s * y) / length, (s * x + c * y) / length, z / length
