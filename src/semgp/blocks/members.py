"""Who takes part in a block: its own sites, single sites near by, and coarse voxels farther out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, I32, I64
from semgp.blocks.layout import Layout
from semgp.blocks.tree import select


class Sizes(NamedTuple):
    """Members of a block: at most `leaf` own sites, `far` coarse voxels, `total` in all."""

    leaf: int
    far: int
    total: int


class Members(NamedTuple):
    """The members of one block.

    X (D, total): positions and features. S (5, total): variances of the positions, and two words of draws; (0,
    total) if all are certain. mass (total, C). k (total,): sites joined.
    """

    X: F32
    S: F32
    mass: F32
    k: F32


@njit(cache=True, nogil=True)
def gather(
    layout: Layout,
    around: I32,
    own: I64,
    edge: float,
    sizes: Sizes,
    marks: I32,
    mark: int,
    out: Members,
) -> int:
    """Fill in the members of a block and return how many there are.

    Parameters
    ----------
    layout : Layout
        The cell of the block and those round about.
    around : (27,) array
        Places of those cells in the layout, -1 for none; the block's own is the one in the middle.
    own : (n,) array
        The block's own sites, as places in the layout.
    edge : float
        Edge of a cell in metres.
    sizes : Sizes
        How many members of each kind.
    marks : (S,) array
        Scratch: `mark` is written where a site has been used. Each block needs another mark.
    mark : int
        See `marks`.
    out : Members
        Where to write.
    """
    low, high = np.empty(3, np.float32), np.empty(3, np.float32)
    for d in range(3):
        if len(own):
            low[d] = high[d] = layout.X[own[0], d]
            for s in own:
                low[d], high[d] = min(low[d], layout.X[s, d]), max(high[d], layout.X[s, d])
        else:
            low[d], high[d] = 0, edge
    n = 0
    for s in own:
        _add_site(layout, s, 0.0, 0.0, 0.0, marks, mark, n, out)
        n += 1
    near_left, far_left = sizes.total - sizes.far - n, sizes.far
    voxels, cells, order = _nearest(layout, around, low, high, edge, sizes.total)
    for i in order:
        v, at = voxels[i], cells[i]
        dx, dy, dz = (at // 9 - 1) * edge, (at // 3 % 3 - 1) * edge, (at % 3 - 1) * edge
        cell = around[at]
        b = layout.first[layout.start[cell] + cell + v]
        e = layout.first[layout.start[cell] + cell + v + 1]
        free = 0
        for s in range(b, e):
            free += marks[s] != mark
        if free == 0:
            continue
        if free <= near_left:
            for s in range(b, e):
                if marks[s] != mark:
                    _add_site(layout, s, dx, dy, dz, marks, mark, n, out)
                    n += 1
            near_left -= free
        elif far_left == 0:
            break
        else:
            _add_coarse(layout, b, e, dx, dy, dz, marks, mark, n, out)
            n += 1
            far_left -= 1
    return n


@njit(cache=True, nogil=True)
def _nearest(layout: Layout, around: I32, low: F32, high: F32, edge: float, wanted: int) -> tuple[I32, I32, I64]:
    """Coarse voxels near a box: index in their cell, place of the cell, and the order of the nearest ones."""
    capacity = 0
    for at in range(27):
        if around[at] >= 0:
            capacity += layout.n_coarse[around[at]]
    voxels, cells = np.empty(capacity, np.int32), np.empty(capacity, np.int32)
    distance = np.empty((capacity, 1), np.float32)
    reach = edge / 8
    n = 0
    while True:
        n = 0
        for at in range(27):
            cell = around[at]
            if cell < 0:
                continue
            dx, dy, dz = (at // 9 - 1) * edge, (at // 3 % 3 - 1) * edge, (at % 3 - 1) * edge
            # cells that begin beyond the reach of the box hold nothing of use
            if (
                dx > high[0] + reach or dx + edge < low[0] - reach
                or dy > high[1] + reach or dy + edge < low[1] - reach
                or dz > high[2] + reach or dz + edge < low[2] - reach
            ):  # fmt: skip
                continue
            first = layout.start[cell]
            for v in range(layout.n_coarse[cell]):
                c = layout.centre[first + v]
                x, y, z = c[0] + dx, c[1] + dy, c[2] + dz
                gx = max(low[0] - x, x - high[0], 0.0)
                gy = max(low[1] - y, y - high[1], 0.0)
                gz = max(low[2] - z, z - high[2], 0.0)
                r2 = gx * gx + gy * gy + gz * gz
                if r2 <= reach * reach:
                    voxels[n], cells[n], distance[n, 0] = v, at, r2
                    n += 1
        if n >= wanted or reach > 2 * edge:
            break
        reach *= 2
    order = np.arange(n)
    if n > wanted:
        select(distance, order, 0, n, wanted, 0)
        order = order[:wanted]
    for i in range(1, len(order)):  # a hundred at most: insertion
        v, j = order[i], i
        while j > 0 and distance[v, 0] < distance[order[j - 1], 0]:
            order[j] = order[j - 1]
            j -= 1
        order[j] = v
    return voxels, cells, order


@njit(cache=True, nogil=True)
def _add_site(
    layout: Layout, s: int, dx: float, dy: float, dz: float, marks: I32, mark: int, n: int, out: Members
) -> None:
    marks[s] = mark
    x = layout.X[s]
    out.X[0, n], out.X[1, n], out.X[2, n] = x[0] + dx, x[1] + dy, x[2] + dz
    for d in range(3, len(x)):
        out.X[d, n] = x[d]
    for d in range(len(out.S)):
        out.S[d, n] = layout.S[s, d]
    for c in range(layout.mass.shape[1]):
        out.mass[n, c] = layout.mass[layout.row[s], c] * layout.unit
    out.k[n] = 1


@njit(cache=True, nogil=True)
def _add_coarse(
    layout: Layout, b: int, e: int, dx: float, dy: float, dz: float, marks: I32, mark: int, n: int, out: Members
) -> None:
    """Add what is free of a coarse voxel as one member."""
    k = 0
    for d in range(out.X.shape[0]):
        out.X[d, n] = 0
    for d in range(len(out.S)):
        out.S[d, n] = 0
    for c in range(layout.mass.shape[1]):
        out.mass[n, c] = 0
    for s in range(b, e):
        if marks[s] == mark:
            continue
        k += 1
        for d in range(out.X.shape[0]):
            out.X[d, n] += layout.X[s, d]
        for d in range(len(out.S)):
            if d < 3:
                out.S[d, n] += layout.S[s, d]
            else:
                out.S[d, n] = int(out.S[d, n]) | int(layout.S[s, d])
        for c in range(layout.mass.shape[1]):
            out.mass[n, c] += layout.mass[layout.row[s], c] * layout.unit
    for d in range(out.X.shape[0]):
        out.X[d, n] /= k
    for d in range(min(len(out.S), 3)):
        out.S[d, n] /= k
    out.X[0, n] += dx
    out.X[1, n] += dy
    out.X[2, n] += dz
    out.k[n] = k
