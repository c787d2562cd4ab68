"""Compiled loops over bricks and their voxels; see `semgp.octomap.bricks.Bricks` for the arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.octomap.morton import BRICK_BITS
from semgp.octomap.ray_kernels import ONE


class Store(NamedTuple):
    """The arrays of B bricks, with room for more."""

    known: NDArray[np.uint64]
    """One bit for each known voxel of a brick."""
    value: NDArray[np.float32]
    """Log-odds of the known voxels of a brick that has no block."""
    block: NDArray[np.int32]
    """Number of the brick's block, counted from 1; 0 for a brick that has none."""
    blocks: NDArray[np.float32]
    """Log-odds of the 64 voxels of a brick, for bricks with different ones."""
    owner: NDArray[np.int64]
    """The brick of each block."""


@njit(cache=True, nogil=True)
def integrate(
    rows: NDArray[np.int64],
    free: NDArray[np.uint64],
    hit: NDArray[np.uint64],
    miss_step: np.float32,
    hit_step: np.float32,
    low: np.float32,
    high: np.float32,
    store: Store,
    n_blocks: int,
) -> tuple[Store, int]:
    """Update each brick; rows are all different."""
    for i in range(len(rows)):
        row = rows[i]
        seen = free[i] | hit[i]
        same_voxels = store.known[row] == 0 or store.known[row] == seen
        same_step = free[i] == 0 or hit[i] == 0
        if store.block[row] == 0 and same_voxels and same_step:
            store.value[row] = _updated(store.value[row], miss_step if hit[i] == 0 else hit_step, low, high)
            store.known[row] = seen
            continue
        store, n_blocks = _split(row, store, n_blocks)
        mine = store.blocks[store.block[row] - 1]
        for v in range(64):
            bit = ONE << np.uint64(v)
            if seen & bit:
                before = mine[v] if store.known[row] & bit else np.float32(0)
                mine[v] = _updated(before, hit_step if hit[i] & bit else miss_step, low, high)
        store.known[row] |= seen
        n_blocks = _merge(row, store, n_blocks)
    return store, n_blocks


@njit(cache=True, nogil=True)
def assign(
    rows: NDArray[np.int64],
    codes: NDArray[np.int64],
    values: NDArray[np.float32],
    store: Store,
    n_blocks: int,
) -> tuple[Store, int]:
    """Set voxels; those of one brick follow each other."""
    for i in range(len(rows)):
        row = rows[i]
        store, n_blocks = _split(row, store, n_blocks)
        store.blocks[store.block[row] - 1, codes[i] & 63] = values[i]
        store.known[row] |= ONE << np.uint64(codes[i] & 63)
        if i + 1 == len(rows) or rows[i + 1] != row:
            n_blocks = _merge(row, store, n_blocks)
    return store, n_blocks


@njit(cache=True, nogil=True)
def find(
    codes: NDArray[np.int64],
    rows: NDArray[np.int64],
    store: Store,
    found: NDArray[np.float32],
    is_known: NDArray[np.bool_],
) -> None:
    """Fill in the log-odds of voxels, given the rows of their bricks (-1 for none)."""
    for i in range(len(codes)):
        row, v = rows[i], codes[i] & 63
        if row >= 0 and store.known[row] >> np.uint64(v) & ONE:
            is_known[i] = True
            found[i] = store.value[row] if store.block[row] == 0 else store.blocks[store.block[row] - 1, v]


@njit(cache=True, nogil=True)
def list_voxels(
    rows: NDArray[np.int64],
    bricks: NDArray[np.int64],
    store: Store,
    codes: NDArray[np.int64],
    values: NDArray[np.float32],
) -> None:
    """Fill in the codes and log-odds of the known voxels of bricks."""
    n = 0
    for row in rows:
        for v in range(64):
            if store.known[row] >> np.uint64(v) & ONE:
                codes[n] = (bricks[row] << BRICK_BITS) | v
                values[n] = store.value[row] if store.block[row] == 0 else store.blocks[store.block[row] - 1, v]
                n += 1


@njit(cache=True, nogil=True)
def _updated(before: np.float32, step: np.float32, low: np.float32, high: np.float32) -> np.float32:
    """Return the log-odds after a step; those at a clamp already, or beyond, stay as they are."""
    if (step >= 0 and before >= high) or (step <= 0 and before <= low):
        return before
    return min(max(before + step, low), high)


@njit(cache=True, nogil=True)
def _split(
    row: int,
    store: Store,
    n_blocks: int,
) -> tuple[Store, int]:
    """Give a brick a block of its own unless it has one."""
    if store.block[row] > 0:
        return store, n_blocks
    if n_blocks == len(store.blocks):
        size = n_blocks + n_blocks // 8 + 16
        more_blocks, more_owner = np.empty((size, 64), dtype=np.float32), np.empty(size, dtype=np.int64)
        more_blocks[:n_blocks], more_owner[:n_blocks] = store.blocks, store.owner
        store = Store(store.known, store.value, store.block, more_blocks, more_owner)
    store.blocks[n_blocks] = store.value[row]
    store.owner[n_blocks] = row
    store.block[row] = n_blocks + 1
    return store, n_blocks + 1


@njit(cache=True, nogil=True)
def _merge(
    row: int,
    store: Store,
    n_blocks: int,
) -> int:
    """Take a brick's block away if its known voxels are all alike; the last block moves into the gap."""
    mine = store.block[row] - 1
    first = -1
    for v in range(64):
        if store.known[row] >> np.uint64(v) & ONE:
            if first < 0:
                first = v
            elif store.blocks[mine, v] != store.blocks[mine, first]:
                return n_blocks
    store.value[row] = store.blocks[mine, first]
    store.block[row] = 0
    last = n_blocks - 1
    if mine != last:
        store.blocks[mine] = store.blocks[last]
        store.owner[mine] = store.owner[last]
        store.block[store.owner[mine]] = mine + 1
    return last
