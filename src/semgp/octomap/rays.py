"""Casting the rays of a cloud: which voxels they pass through and which they end in.

A voxel is one bit of its brick's 64-bit masks, so that a voxel that a thousand rays pass through is marked, not
listed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.octomap.index import CodeIndex
from semgp.octomap.morton import BRICK_BITS, DEPTH, cell_centres
from semgp.octomap.ray_kernels import IN_PAGE, ONE, PAGE_BITS, RAY, aim, walk
from semgp.parallel import n_workers, parallel_map, slices


@dataclass(frozen=True, eq=False)
class Sighting:
    """What a cloud says of the voxels of B bricks.

    Parameters
    ----------
    bricks : (B,) array
        Codes of the bricks, ascending.
    free : (B,) uint64 array
        One bit a voxel: some ray passed through it, and none ended there.
    hit : (B,) uint64 array
        One bit a voxel: some ray ended there.
    """

    bricks: NDArray[np.int64]
    free: NDArray[np.uint64]
    hit: NDArray[np.uint64]


def cast_rays(
    points: NDArray[np.float32],
    codes: NDArray[np.int64],
    origin: NDArray[np.float32],
    resolution: float,
    max_range: float = math.inf,
) -> tuple[Sighting, NDArray[np.bool_]]:
    """Cast a ray from the origin (3,) to each point.

    Parameters
    ----------
    points : (N, 3) array
        Where the rays end, N > 0; inside the root, as must be the origin.
    codes : (N,) array
        The points' voxels.
    origin : (3,) array
        Where the rays begin.
    resolution : float
        Edge of a voxel.
    max_range : float, optional
        A ray that is longer is cut to this length and hits nothing.

    Returns
    -------
    sighting : Sighting
        The voxels passed and hit.
    reached : (N,) bool array
        True where a point counts as a hit, because its ray was not cut.
    """
    reached = np.empty(len(points), dtype=np.bool_)

    def cast(part: slice) -> tuple[NDArray[np.int64], NDArray[np.uint64]]:
        rays = np.empty(part.stop - part.start, dtype=RAY)
        start = aim(points[part], codes[part], origin, resolution, max_range, rays, reached[part])
        pages, passed = walk(rays, start)
        used = np.flatnonzero(passed)
        return (pages[used // (IN_PAGE + 1)] << PAGE_BITS - BRICK_BITS) | (used & IN_PAGE), passed[used]

    size = max(1 << 14, -(-len(points) // n_workers()))
    parts = parallel_map(cast, slices(len(points), size))
    ends = sight_ends(codes[reached])
    bricks = np.concatenate([ends.bricks, *(part[0] for part in parts)])
    passed = np.concatenate([np.zeros_like(ends.hit), *(part[1] for part in parts)])
    hit = np.append(ends.hit, np.zeros(len(bricks) - len(ends.hit), dtype=np.uint64))
    order = np.argsort(bricks)
    first = np.flatnonzero(np.diff(bricks[order], prepend=-1))
    hit = np.bitwise_or.reduceat(hit[order], first)
    free = np.bitwise_or.reduceat(passed[order], first) & ~hit
    return Sighting(bricks[order[first]], free, hit), reached


def cast_discretized(
    codes: NDArray[np.int64],
    origin: NDArray[np.float32],
    resolution: float,
    max_range: float = math.inf,
) -> tuple[Sighting, NDArray[np.bool_]]:
    """Cast one ray to the centre of each voxel that holds points; see `cast_rays`."""
    voxels = CodeIndex()
    row = voxels.add(codes)
    centres = cell_centres(voxels.codes, np.full(len(voxels), DEPTH), resolution).astype(np.float32)
    sighting, reached = cast_rays(centres, voxels.codes, origin, resolution, max_range)
    return sighting, reached[row]


def sight_ends(codes: NDArray[np.int64]) -> Sighting:
    """Return what points (N,) say without rays: their voxels are hit, none is free."""
    codes = np.sort(codes)
    first = np.flatnonzero(np.diff(codes >> BRICK_BITS, prepend=-1))
    hit = np.bitwise_or.reduceat(np.left_shift(ONE, (codes & 63).astype(np.uint64)), first)
    return Sighting(codes[first] >> BRICK_BITS, np.zeros_like(hit), hit)
