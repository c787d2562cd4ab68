"""Balanced k-d trees of a cell's sites, and the leaves that a small box overlaps.

The node of the leaves [a, b) has the children [a, h) and [h, b), h = (a + b) // 2; its plane lies in place h - 1
of two flat arrays, so a tree of L leaves takes L - 1 places. Sites are shared out in proportion to the leaves.
Trees depend on the sites alone, not on the order in which they came.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, I8, I64


@njit(cache=True, nogil=True)
def split(X: F32, order: I64, n_leaves: int, axes: I8, cuts: F32, bounds: I64) -> None:
    """Sort the sites X (n, D) into the leaves of a tree: parts along the widest of the three coordinates.

    Fills in `order` (n,), the sites leaf by leaf; `bounds` (n_leaves + 1,), where each leaf begins in it; and
    `axes` and `cuts` (n_leaves - 1,), the planes.
    """
    n = len(order)
    for i in range(n):
        order[i] = i
    bounds[0], bounds[n_leaves] = 0, n
    firsts, lasts = np.empty(n_leaves, np.int64), np.empty(n_leaves, np.int64)
    firsts[0], lasts[0], waiting = 0, n_leaves, 1
    while waiting:
        waiting -= 1
        first, last = firsts[waiting], lasts[waiting]
        if last - first == 1:
            continue
        half = (first + last) // 2
        a, b = bounds[first], bounds[last]
        middle = a + (b - a) * (half - first) // (last - first)
        axis = _widest(X, order, a, b)
        select(X, order, a, b, middle, axis)
        below = X[order[a], axis]
        for i in range(a, middle):
            below = max(below, X[order[i], axis])
        axes[half - 1], cuts[half - 1] = axis, (below + X[order[middle], axis]) / 2
        bounds[half] = middle
        firsts[waiting], lasts[waiting] = first, half
        firsts[waiting + 1], lasts[waiting + 1] = half, last
        waiting += 2


@njit(cache=True, nogil=True)
def _widest(X: F32, order: I64, a: int, b: int) -> int:
    best, widest = 0, np.float32(-1)
    for axis in range(3):
        low = high = X[order[a], axis]
        for i in range(a + 1, b):
            v = X[order[i], axis]
            low, high = min(low, v), max(high, v)
        if high - low > widest:
            best, widest = axis, high - low
    return best


@njit(cache=True, nogil=True)
def select(X: F32, order: I64, a: int, b: int, k: int, axis: int) -> None:
    """Bring the site that belongs to place k of order[a:b], by coordinate and then index, to its place."""
    low, high = a, b - 1
    while low < high:
        pivot = order[(low + high) // 2]
        value = X[pivot, axis]
        i, j = low, high
        while i <= j:
            while X[order[i], axis] < value or (X[order[i], axis] == value and order[i] < pivot):
                i += 1
            while X[order[j], axis] > value or (X[order[j], axis] == value and order[j] > pivot):
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            return


@njit(cache=True, nogil=True)
def overlapped(
    axes: I8, cuts: F32, start: int, n_leaves: int, low: F32, high: F32, leaves: I64, shares: F32
) -> int:
    """Find the leaves of the tree at `start` that a box overlaps, with the share of the box in each.

    Returns the number of leaves; fills in `leaves` and `shares`. The shares add up to one.
    """
    n = 1
    ends = np.empty(len(leaves), np.int64)
    lows, highs = np.empty((len(leaves), 3), np.float32), np.empty((len(leaves), 3), np.float32)
    leaves[0], ends[0], shares[0] = 0, n_leaves, 1
    for d in range(3):
        lows[0, d], highs[0, d] = low[d], high[d]
    i = 0
    while i < n:
        first, last = leaves[i], ends[i]
        if last - first == 1:
            i += 1
            continue
        half = (first + last) // 2
        axis, cut = axes[start + half - 1], cuts[start + half - 1]
        if highs[i, axis] <= cut:
            ends[i] = half
        elif lows[i, axis] >= cut:
            leaves[i] = half
        elif n == len(leaves):  # more leaves than a box of a voxel's size meets: stay on the larger side
            if highs[i, axis] - cut > cut - lows[i, axis]:
                leaves[i] = half
            else:
                ends[i] = half
        else:
            part = (cut - lows[i, axis]) / (highs[i, axis] - lows[i, axis])
            leaves[n], ends[n], shares[n] = half, last, shares[i] * (1 - part)
            for d in range(3):
                lows[n, d], highs[n, d] = lows[i, d], highs[i, d]
            lows[n, axis] = highs[i, axis] = cut
            ends[i] = half
            shares[i] *= part
            n += 1
    return n
