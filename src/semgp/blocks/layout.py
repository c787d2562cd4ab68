"""The sites of some cells laid out for solving: cell by cell, and within a cell by coarse voxel.

A coarse voxel joins 4 x 4 x 4 voxels. Far from a block, its sites act as one: the block's halo has single sites
near by and coarse voxels farther out, so that a few dozen observations reach many metres.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from semgp.blocks.accumulate import FEATURE_UNIT, MASS_UNIT, PLACE_UNIT, SPREAD_UNIT
from semgp.blocks.arrays import F32, I32, I64, U32
from semgp.blocks.cells import CELL_BITS
from semgp.blocks.sites import Sites
from semgp.parallel import n_workers, parallel_map, slices
from semgp.voxels import STEP

COARSE_BITS = 2

WORD_BITS = 24
WORD = (1 << WORD_BITS) - 1
"""A set of draws in words that single precision holds exactly."""

_OFFSETS = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])


class Layout(NamedTuple):
    """Sites and coarse voxels of L cells.

    cells (L,): ids. start (L + 1,): where each cell's sites begin. row (S,): index of each site in `Sites`.
    X (S, D): position in metres from the cell's lowest corner, and features. first (S + L,): where each coarse
    voxel's sites begin, and the last one's end, from `start[i] + i` on for cell i. n_coarse (L,): coarse voxels of
    each cell. centre (S, D): mean of the sites of each coarse voxel, from `start[i]` on. S (S, 5): variances of
    each position, m^2, and its set of draws in two words; (0, 5) if all are certain. mass (sites, C): class mass
    of all sites of the map, in steps of `unit`.
    """

    cells: I32
    start: I64
    row: I32
    X: F32
    first: I32
    n_coarse: I32
    centre: F32
    S: F32
    mass: U32
    unit: float


def lay_out(sites: Sites, cells: I32) -> Layout:
    """Return the layout of cells, given by their ids in ascending order of their keys."""
    counts = sites.size[cells].astype(np.int64)
    start = np.concatenate([[0], counts.cumsum()])
    S, D = int(start[-1]), sites.place.shape[1]
    row, first = np.empty(S, np.int32), np.empty(S + len(cells), np.int32)
    X, centre = np.empty((S, D), np.float32), np.empty((S, D), np.float32)
    n_coarse = np.zeros(len(cells), np.int32)
    spread = np.empty((S if len(sites.spread) else 0, 5), np.float32)
    layout = Layout(cells, start, row, X, first, n_coarse, centre, spread, sites.mass, 1.0 / MASS_UNIT)

    def fill(part: slice) -> None:
        _fill(
            layout, part.start, part.stop, sites.head, sites.next, sites.voxels.keys, sites.place, sites.spread,
            sites.resolution,
        )  # fmt: skip

    parallel_map(fill, slices(len(cells), max(1, len(cells) // (4 * n_workers()))))
    return layout


def neighbours(sites: Sites, cells: I32) -> I32:
    """Return the ids (n, 27) of the cells round about each cell, in the order of their keys, -1 for none."""
    around = around_keys(sites.cells.keys[cells])
    return sites.cells.find(around.ravel()).reshape(-1, 27).astype(np.int32)


def around_keys(keys: I64) -> I64:
    """Return the keys (n, 27) of the cells round about those of keys (n,), ascending."""
    offset = (_OFFSETS << CELL_BITS) @ np.array(STEP, dtype=np.int64)
    return np.asarray(keys[:, None] + offset)


@njit(cache=True, nogil=True)
def _fill(
    layout: Layout,
    begin: int,
    end: int,
    head: I32,
    following: I32,
    keys: I64,
    place: I64,
    spread: I64,
    resolution: float,
) -> None:
    cells, start, row, X, first, n_coarse, centre, S, mass, _ = layout
    low = (1 << CELL_BITS) - 1
    fine = (1 << COARSE_BITS) - 1
    D = place.shape[1]
    for i in range(begin, end):
        a, n = start[i], start[i + 1] - start[i]
        codes, chained = np.empty(n, np.int64), np.empty(n, np.int32)
        r = head[cells[i]]
        for j in range(n):
            x, y, z = keys[r] >> 42 & low, keys[r] >> 21 & low, keys[r] & low
            coarse = ((x >> COARSE_BITS) << 12) | ((y >> COARSE_BITS) << 6) | (z >> COARSE_BITS)
            codes[j] = (coarse << 6) | ((x & fine) << 4) | ((y & fine) << 2) | (z & fine)
            chained[j] = r
            r = following[r]
        order = np.argsort(codes)
        previous, m = np.int64(-1), 0
        for j in range(n):
            r, s = chained[order[j]], a + j
            row[s] = r
            total = np.int64(0)
            for c in range(mass.shape[1]):
                total += np.int64(mass[r, c])
            scale = resolution / (total * float(PLACE_UNIT))
            X[s, 0] = (keys[r] >> 42 & low) * resolution + place[r, 0] * scale
            X[s, 1] = (keys[r] >> 21 & low) * resolution + place[r, 1] * scale
            X[s, 2] = (keys[r] & low) * resolution + place[r, 2] * scale
            if len(S):
                for d in range(3):
                    S[s, d] = spread[r, d] / (total * float(SPREAD_UNIT))
                S[s, 3], S[s, 4] = spread[r, 3] & WORD, spread[r, 3] >> WORD_BITS
            for d in range(3, D):
                X[s, d] = place[r, d] / (total * float(FEATURE_UNIT))
            if codes[order[j]] >> 6 != previous:
                previous = codes[order[j]] >> 6
                first[a + i + m] = s
                m += 1
        first[a + i + m] = a + n
        n_coarse[i] = m
        for k in range(m):
            b, e = first[a + i + k], first[a + i + k + 1]
            for d in range(D):
                total_x = np.float32(0)
                for s in range(b, e):
                    total_x += X[s, d]
                centre[a + k, d] = total_x / np.float32(e - b)
