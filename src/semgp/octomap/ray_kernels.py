"""Compiled loops over rays: aimed from the origin at points, and walked from voxel to voxel.

The traversal is OctoMap's (`computeUpdate` and `computeRayKeys`, after Amanatides and Woo, 1987) down to its
roundings: points, directions and lengths are float32, distances along a ray float64.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.octomap.index import first_slot, slots_of
from semgp.octomap.morton import BRICK_BITS, HALF, X_BITS, Y_BITS, Z_BITS, key_along, voxel_code

PAGE_BITS = 15
"""Masks are allotted by the page, 32 x 32 x 32 voxels, which share all but the last 15 bits of code."""

FAR = 1.7976931348623157e308  # the largest float64: where a ray crosses an axis to which it is perpendicular
ONE = np.uint64(1)

IN_PAGE = (1 << PAGE_BITS - BRICK_BITS) - 1
"""A brick's place in its page is these bits of its code."""

RAY = np.dtype(
    [(f"{name}_{axis}", kind) for axis in "xyz" for name, kind in (("step", "i8"), ("t", "f8"), ("dt", "f8"))]
    + [("end", "i8"), ("length", "f8")]
)
"""A ray that is about to be walked.

Along each axis, t is how far from the origin it crosses into the next voxel, dt how far apart its crossings
are, and step what a crossing adds to the axis' bits of the code. `end` is the voxel where it ends.
"""


@njit(cache=True, nogil=True, error_model="numpy")
def aim(
    points: NDArray[np.float32],
    codes: NDArray[np.int64],
    origin: NDArray[np.float32],
    resolution: float,
    max_range: float,
    rays: NDArray[Any],
    reached: NDArray[np.bool_],
) -> int:
    """Fill in the rays, cut to range, and return the voxel that they begin in."""
    factor = 1.0 / resolution
    start = voxel_code(origin[0], origin[1], origin[2], factor)
    for i in range(len(points)):
        ray = rays[i]
        ray.end = codes[i]
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        length = _norm(x - origin[0], y - origin[1], z - origin[2])
        reached[i] = length <= max_range
        if not reached[i]:
            x = origin[0] + (x - origin[0]) / np.float32(length) * np.float32(max_range)
            y = origin[1] + (y - origin[1]) / np.float32(length) * np.float32(max_range)
            z = origin[2] + (z - origin[2]) / np.float32(length) * np.float32(max_range)
            ray.end = voxel_code(x, y, z, factor)
        x, y, z = x - origin[0], y - origin[1], z - origin[2]
        norm = np.float32(_norm(x, y, z))
        ray.length = norm
        ray.step_x, ray.t_x, ray.dt_x = _crossings(0, x / norm, origin[0], start, resolution)
        ray.step_y, ray.t_y, ray.dt_y = _crossings(1, y / norm, origin[1], start, resolution)
        ray.step_z, ray.t_z, ray.dt_z = _crossings(2, z / norm, origin[2], start, resolution)
    return start


@njit(cache=True, nogil=True)
def walk(rays: NDArray[Any], start: int) -> tuple[NDArray[np.int64], NDArray[np.uint64]]:
    """Return the pages that the rays meet and, for each brick of them, the mask of the voxels passed.

    A ray passes the voxel that it begins in and not the one that it ends in.
    """
    pages = np.empty(16, dtype=np.int64)
    slots = slots_of(pages, 0, len(pages))
    passed = np.zeros((IN_PAGE + 1) * len(pages), dtype=np.uint64)
    n = 0
    for i in range(len(rays)):
        ray = rays[i]
        step_x, step_y, step_z = ray.step_x, ray.step_y, ray.step_z
        dt_x, dt_y, dt_z = ray.dt_x, ray.dt_y, ray.dt_z
        t_x, t_y, t_z = ray.t_x, ray.t_y, ray.t_z
        end, length = ray.end, ray.length
        if end == start:
            continue
        code, x, y, z = start, start & X_BITS, start & Y_BITS, start & Z_BITS
        page, first_brick = -1, 0
        while True:
            if code >> PAGE_BITS != page:  # `CodeIndex.add`, written out for speed
                page = code >> PAGE_BITS
                slot = first_slot(page, len(slots))
                while slots[slot] >= 0 and pages[slots[slot]] != page:
                    slot = (slot + 1) & (len(slots) - 1)
                if slots[slot] < 0:
                    if n == len(pages):
                        pages, passed = _doubled(pages), _doubled(passed)
                        slots = slots_of(pages, n, len(pages))
                        page = -1
                        continue
                    slots[slot] = n
                    pages[n] = page
                    n += 1
                first_brick = slots[slot] * (IN_PAGE + 1)
            brick = np.uint64(first_brick | ((code >> BRICK_BITS) & IN_PAGE))
            passed[brick] |= ONE << np.uint64(code & 63)
            # A step adds to one axis' bits of the code; masking them drops what carries into the other axes.
            if t_x < t_y and t_x < t_z:
                x = (x + step_x) & X_BITS
                t_x += dt_x
            elif t_y < t_z and not t_x < t_y:
                y = (y + step_y) & Y_BITS
                t_y += dt_y
            else:
                z = (z + step_z) & Z_BITS
                t_z += dt_z
            code = x | y | z
            # Rounding can make a ray miss the voxel of its end: then it stops where its length is used up.
            if code == end or (t_x > length and t_y > length and t_z > length):
                break
    return pages, passed


@njit(cache=True, nogil=True, error_model="numpy")
def _crossings(
    axis: int, direction: np.float32, origin: np.float32, start: int, resolution: float
) -> tuple[int, float, float]:
    """Return step, t and dt of a ray along an axis."""
    if direction == 0:
        return 0, FAR, FAR
    sign = 1 if direction > 0 else -1
    centre = (key_along(axis, start) - HALF + 0.5) * resolution
    border = centre + np.float64(np.float32(sign * resolution * 0.5))
    # minus all bits of the axis is plus one, once the other axes' bits are masked out
    step = -(X_BITS << axis) if sign > 0 else -(1 << axis)
    return step, (border - origin) / direction, resolution / abs(np.float64(direction))


@njit(cache=True, nogil=True)
def _norm(x: np.float32, y: np.float32, z: np.float32) -> float:
    return math.sqrt(np.float64(x * x + y * y + z * z))


@njit(cache=True, nogil=True)
def _doubled(array: NDArray[Any]) -> NDArray[Any]:
    larger = np.zeros(2 * len(array), dtype=array.dtype)
    larger[: len(array)] = array
    return larger
