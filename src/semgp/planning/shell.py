"""The shell of boxes round a map's surfaces, and the samples of rays that lie in it."""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.parallel import n_workers, parallel_map, slices
from semgp.voxels import AXIS_BITS, HALF_RANGE, STEP, VoxelTable, slot_of, voxel_keys, voxel_origin

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


class Shell(NamedTuple):
    """Coarse voxels near a map's surfaces, and in each the box in which surfaces may be.

    edge: of a voxel, metres. origin (3,): voxel at the origin of the keys. low, high (3,): corners of a box round
    everything, metres. slots, keys: a hash table of the voxels, see `semgp.voxels.slot_of`. boxes (n, 6): low and
    high corner of the box in each, metres.
    """

    edge: float
    origin: F64
    low: F64
    high: F64
    slots: I64
    keys: I64
    boxes: F64


def shell_around(positions: F64, reach: float) -> Shell:
    """Return the shell of what lies within a reach of positions (n, 3), n > 0, along each axis."""
    edge = 2 * reach
    origin = voxel_origin(positions, edge)
    # A cube as wide as a voxel meets two of them along each axis: that of its lowest corner, and the next.
    lowest = voxel_keys(positions - reach, edge, origin)
    voxels = VoxelTable()
    rows = [voxels.insert(lowest + np.dot(corner, STEP)) for corner in product((0, 1), repeat=3)]
    boxes = np.repeat([[np.inf, -np.inf]], 3, axis=1).repeat(len(voxels), axis=0)
    for row in rows:
        _widen(boxes, row, positions, reach)
    low, high = positions.min(axis=0) - edge, positions.max(axis=0) + edge
    return Shell(edge, origin.astype(np.float64), low, high, voxels.slots, voxels.keys, boxes)


def next_samples(
    origins: F64, directions: F64, n_steps: int, step: float, shell: Shell, following: I64, wanted: int
) -> I64:
    """Return the next so many samples (R, wanted) of each ray that lie in the shell, -1 where it has no more.

    Sample k lies k steps along its ray, 0 <= k <= n_steps. `following` (R,), where each ray is to go on, is moved.
    """
    found = np.full((len(origins), wanted), -1, dtype=np.int64)

    def run(part: slice) -> None:
        _walk(origins[part], directions[part], n_steps, step, shell, following[part], found[part])

    parallel_map(run, slices(len(origins), max(1024, -(-len(origins) // n_workers()))))
    return found


@njit(cache=True, nogil=True)
def _widen(boxes: F64, row: I64, positions: F64, reach: float) -> None:
    """Have boxes hold the cubes round positions."""
    for i in range(len(row)):
        box = boxes[row[i]]
        for axis in range(3):
            box[axis] = min(box[axis], positions[i, axis] - reach)
            box[axis + 3] = max(box[axis + 3], positions[i, axis] + reach)


@njit(cache=True, nogil=True, error_model="numpy")
def _walk(
    origins: F64, directions: F64, n_steps: int, step: float, shell: Shell, following: I64, found: I64
) -> None:
    x, cell = np.empty(3), np.empty(3)
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        first, last = _through_box(o, d, shell.low, shell.high)
        k, end, n = max(following[i], _ceil(first / step, n_steps)), min(_ceil(last / step, n_steps), n_steps), 0
        while k <= end and n < found.shape[1]:
            key = np.int64(0)
            for axis in range(3):
                x[axis] = o[axis] + k * step * d[axis]
                cell[axis] = math.floor(x[axis] / shell.edge)
                key = (key << AXIS_BITS) + np.int64(cell[axis] - shell.origin[axis]) + HALF_RANGE
            row = shell.slots[slot_of(key, shell.slots, shell.keys)]
            if row < 0:
                k = max(k + 1, _ceil(_way_out(o, d, cell, shell.edge) / step, n_steps))
                continue
            if _inside(x, shell.boxes[row]):
                found[i, n] = k
                n += 1
            k += 1
        following[i] = k


@njit(cache=True, nogil=True)
def _inside(x: F64, box: F64) -> bool:
    return bool(box[0] <= x[0] <= box[3] and box[1] <= x[1] <= box[4] and box[2] <= x[2] <= box[5])


@njit(cache=True, nogil=True)
def _ceil(x: float, n_steps: int) -> np.int64:
    """Round up to a sample, at most one more than there are."""
    return np.int64(math.ceil(min(max(x, 0.0), n_steps + 1.0)))


@njit(cache=True, nogil=True, error_model="numpy")
def _way_out(o: F64, d: F64, cell: F64, edge: float) -> float:
    """Return how far from its origin a ray leaves a voxel."""
    way = np.inf
    for axis in range(3):
        if d[axis] != 0.0:
            way = min(way, ((cell[axis] + (1.0 if d[axis] > 0.0 else 0.0)) * edge - o[axis]) / d[axis])
    return way


@njit(cache=True, nogil=True, error_model="numpy")
def _through_box(o: F64, d: F64, low: F64, high: F64) -> tuple[float, float]:
    """Return where a ray enters a box and leaves it: the first beyond the last where it misses."""
    first, last = 0.0, np.inf
    for axis in range(3):
        if d[axis] == 0.0:
            if not low[axis] <= o[axis] <= high[axis]:
                return 1.0, 0.0
        else:
            a, b = (low[axis] - o[axis]) / d[axis], (high[axis] - o[axis]) / d[axis]
            first, last = max(first, min(a, b)), min(last, max(a, b))
    return first, last
