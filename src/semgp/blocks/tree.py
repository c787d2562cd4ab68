"""Balanced k-d trees of a cell's sites, and the leaves that a small box overlaps.

A tree of 2^depth leaves lies in two flat arrays, level by level, as a heap: node i has the children 2 i + 1 and
2 i + 2. Trees depend on the sites alone, not on the order in which they came.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, I8, I64

Int = I64


@njit(cache=True, nogil=True)
def split(X: F32, order: Int, depth: int, axes: I8, cuts: F32, bounds: Int) -> None:
    """Sort the sites X (n, D) into the leaves of a tree: halves along the widest of the three coordinates.

    Fills in `order` (n,), the sites leaf by leaf; `bounds` (2^depth + 1,), where each leaf begins in it; and
    `axes` and `cuts` (2^depth - 1,), the planes.
    """
    n = len(order)
    for i in range(n):
        order[i] = i
    bounds[0], bounds[1] = 0, n
    for level in range(depth):
        for k in range((1 << level) - 1, -1, -1):
            a, b = bounds[k], bounds[k + 1]
            middle = (a + b) // 2
            axis = _widest(X, order, a, b)
            _select(X, order, a, b, middle, axis)
            node = (1 << level) - 1 + k
            below = X[order[a], axis]
            for i in range(a, middle):
                below = max(below, X[order[i], axis])
            axes[node], cuts[node] = axis, (below + X[order[middle], axis]) / 2
            bounds[2 * k + 2], bounds[2 * k + 1] = b, middle
            bounds[2 * k] = a


@njit(cache=True, nogil=True)
def _widest(X: F32, order: Int, a: int, b: int) -> int:
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
def _select(X: F32, order: Int, a: int, b: int, k: int, axis: int) -> None:
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
def overlapped(axes: I8, cuts: F32, start: int, depth: int, low: F32, high: F32, leaves: Int, shares: F32) -> int:
    """Find the leaves of the tree at `start` that a box overlaps, with the share of the box in each.

    Returns the number of leaves; fills in `leaves` and `shares`. The shares add up to one.
    """
    n = 1
    leaves[0], shares[0] = 0, 1
    lows, highs = np.empty((len(leaves), 3), np.float32), np.empty((len(leaves), 3), np.float32)
    for d in range(3):
        lows[0, d], highs[0, d] = low[d], high[d]
    for level in range(depth):
        for i in range(n):
            node = start + (1 << level) - 1 + leaves[i]
            axis, cut = axes[node], cuts[node]
            leaves[i] *= 2
            if highs[i, axis] <= cut:
                continue
            if lows[i, axis] >= cut:
                leaves[i] += 1
                continue
            if n == len(leaves):  # more leaves than any box of a voxel's size meets: stay on the larger side
                if highs[i, axis] - cut > cut - lows[i, axis]:
                    leaves[i] += 1
                continue
            part = (cut - lows[i, axis]) / (highs[i, axis] - lows[i, axis])
            leaves[n], shares[n] = leaves[i] + 1, shares[i] * (1 - part)
            for d in range(3):
                lows[n, d], highs[n, d] = lows[i, d], highs[i, d]
            lows[n, axis] = highs[i, axis] = cut
            shares[i] *= part
            n += 1
    return n
