"""Which blocks answer which query points, and with what weight.

A small box is put round each point; each block answers with the share of the box that lies in its leaf. The
answer changes without a jump, therefore, when a point crosses the border between two blocks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, F64, I8, I32, I64, Bool
from semgp.blocks.cells import CELL, CELL_BITS
from semgp.blocks.growing import longer, longer_rows
from semgp.blocks.tree import overlapped
from semgp.voxels import AXIS_BITS, HALF_RANGE, slot_of

_MOST = 64  # leaves of one cell, and blocks in all, that may answer one point


class Pairs(NamedTuple):
    """Point, block and weight, all (n,), point by point; block -1 where the map knows nothing.

    local (n, 3): the point in metres from the lowest corner of the block's cell.
    """

    point: I32
    block: I64
    weight: F32
    local: F32


class CellTrees(NamedTuple):
    """Cells by key; for each its first block (-1: none), leaves and place of its tree; and all trees."""

    slots: I64
    keys: I64
    block: I64
    leaves: I64
    tree_at: I64
    axes: I8
    cuts: F32


@njit(cache=True, nogil=True)
def mark_cells(
    points: F64, resolution: float, origin: F64, half: float, slots: I64, keys: I64, needed: Bool
) -> I64:
    """Mark the cells that the boxes round points overlap, and return the keys of those that are not known."""
    unknown = np.empty(64, np.int64)
    n = 0
    low, high, v = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3)
    for i in range(len(points)):
        if not _place(points[i], resolution, origin, v):
            continue
        for d in range(3):
            low[d], high[d] = _cell(v[d] - half), _cell(v[d] + half)
        for x in range(low[0], high[0] + 1):
            for y in range(low[1], high[1] + 1):
                for z in range(low[2], high[2] + 1):
                    key = _key(x, y, z)
                    cell = slots[slot_of(key, slots, keys)]
                    if cell >= 0:
                        needed[cell] = True
                    elif n == 0 or unknown[n - 1] != key:
                        if n == len(unknown):
                            unknown = longer(unknown, 2 * n)
                        unknown[n] = key
                        n += 1
    return unknown[:n]


@njit(cache=True, nogil=True)
def find_pairs(points: F64, chosen: I64, resolution: float, origin: F64, half: float, trees: CellTrees) -> Pairs:
    """Return the pairs of some points.

    Parameters
    ----------
    points : (M, 3) array
        Metres, world frame.
    chosen : (n,) array
        The points that are asked for.
    resolution : float
        Edge of a voxel in metres.
    origin : (3,) array
        Voxel at the origin of the keys.
    half : float
        Half the edge of the box round each point, in voxels.
    trees : CellTrees
        The solved cells.
    """
    capacity = 2 * len(chosen) + 8 * _MOST
    point, block = np.empty(capacity, np.int32), np.empty(capacity, np.int64)
    weight, local = np.empty(capacity, np.float32), np.empty((capacity, 3), np.float32)
    leaves, shares = np.empty(_MOST, np.int64), np.empty(_MOST, np.float32)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    box_low, box_high = np.empty(3, np.float32), np.empty(3, np.float32)
    v, part = np.empty(3), np.empty(3)
    n = 0
    for i in chosen:
        if n + 8 * _MOST > capacity:
            capacity = 2 * capacity + 8 * _MOST
            point, block = longer(point, capacity), longer(block, capacity)
            weight, local = longer(weight, capacity), longer_rows(local, capacity)
        if not _place(points[i], resolution, origin, v):
            point[n], block[n], weight[n] = i, -1, 1
            for d in range(3):
                local[n, d] = 0
            n += 1
            continue
        for d in range(3):
            low[d], high[d] = _cell(v[d] - half), _cell(v[d] + half)
        for x in range(low[0], high[0] + 1):
            part[0] = _share(v[0], half, x, low[0], high[0])
            for y in range(low[1], high[1] + 1):
                part[1] = part[0] * _share(v[1], half, y, low[1], high[1])
                for z in range(low[2], high[2] + 1):
                    part[2] = part[1] * _share(v[2], half, z, low[2], high[2])
                    key = _key(x, y, z)
                    cell = trees.slots[slot_of(key, trees.slots, trees.keys)]
                    known = cell >= 0 and trees.block[cell] >= 0
                    for d in range(3):
                        corner = (x if d == 0 else y if d == 1 else z) * CELL
                        box_low[d], box_high[d] = (v[d] - half - corner), (v[d] + half - corner)
                        local[n, d] = (v[d] - corner) * resolution
                        box_low[d] = max(box_low[d], np.float32(0)) * np.float32(resolution)
                        box_high[d] = min(box_high[d], np.float32(CELL)) * np.float32(resolution)
                    found = 1
                    if known:
                        found = overlapped(
                            trees.axes, trees.cuts, trees.tree_at[cell], trees.leaves[cell], box_low, box_high,
                            leaves, shares,
                        )  # fmt: skip
                    else:
                        leaves[0], shares[0] = 0, 1
                    base = n
                    for k in range(found):
                        point[n] = i
                        block[n] = trees.block[cell] + leaves[k] if known else -1
                        weight[n] = part[2] * shares[k]
                        for d in range(3):
                            local[n, d] = local[base, d]
                        n += 1
    return Pairs(point[:n], block[:n], weight[:n], local[:n])


@njit(cache=True, nogil=True)
def home_blocks(points: F64, resolution: float, origin: F64, trees: CellTrees, block: I64, local: F32) -> None:
    """Fill in the block (M,) in whose leaf each point lies, -1 for none, and its place (M, 3) in the cell."""
    corner, v = np.empty(3, np.int64), np.empty(3)
    place = np.empty(3, np.float32)
    leaf, share = np.empty(1, np.int64), np.empty(1, np.float32)
    for i in range(len(points)):
        block[i] = -1
        for d in range(3):
            local[i, d] = 0
        if not _place(points[i], resolution, origin, v):
            continue
        for d in range(3):
            corner[d] = _cell(v[d])
            place[d] = local[i, d] = (v[d] - corner[d] * CELL) * resolution
        cell = trees.slots[slot_of(_key(corner[0], corner[1], corner[2]), trees.slots, trees.keys)]
        if cell >= 0 and trees.block[cell] >= 0:
            overlapped(trees.axes, trees.cuts, trees.tree_at[cell], trees.leaves[cell], place, place, leaf, share)
            block[i] = trees.block[cell] + leaf[0]


@njit(cache=True, nogil=True)
def _place(point: F64, resolution: float, origin: F64, v: F64) -> bool:
    """Fill in the place v (3,) of a point in voxels from the origin; False beyond the range of the keys."""
    inside = True
    for d in range(3):
        v[d] = point[d] / resolution - origin[d]
        inside = inside and -HALF_RANGE + CELL < v[d] < HALF_RANGE - CELL
    return inside


@njit(cache=True, nogil=True, inline="always")
def _cell(v: float) -> np.int64:
    return np.int64(np.floor(v)) >> CELL_BITS


@njit(cache=True, nogil=True, inline="always")
def _key(x: int, y: int, z: int) -> np.int64:
    shift = HALF_RANGE >> CELL_BITS
    return (
        (np.int64(x + shift) << (2 * AXIS_BITS + CELL_BITS))
        + (np.int64(y + shift) << (AXIS_BITS + CELL_BITS))
        + (np.int64(z + shift) << CELL_BITS)
    )


@njit(cache=True, nogil=True, inline="always")
def _share(v: float, half: float, x: int, low: int, high: int) -> float:
    """Share along one axis of the box round v that lies in cell x."""
    if low == high:
        return 1.0
    a, b = max(v - half, float(x * CELL)), min(v + half, float((x + 1) * CELL))
    return max(b - a, 0.0) / (2 * half)
