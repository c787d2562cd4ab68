"""The map as OctoMap's tree: pruned leaves, inner nodes, unknown space, and values at any depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.octomap.morton import BRICK_DEPTH, DEPTH

EIGHT = np.arange(8)


@dataclass(frozen=True, eq=False)
class Leaves:
    """L cells that share no voxel, in the order of their codes.

    Parameters
    ----------
    first : (L,) int64 array
        Code of each cell's first voxel.
    depth : (L,) int64 array
        Depth of each cell; a cell of depth d has 8^(16 - d) voxels, whose codes follow each other.
    state : (L,) array
        What its voxels have in common.
    """

    first: NDArray[np.int64]
    depth: NDArray[np.int64]
    state: NDArray[Any]

    def __len__(self) -> int:
        return len(self.first)

    def __getitem__(self, keep: NDArray[np.bool_]) -> Leaves:
        """Return the leaves that a mask selects."""
        return Leaves(self.first[keep], self.depth[keep], self.state[keep])


@dataclass(frozen=True, eq=False)
class Nodes:
    """The Q nodes of a tree, inner ones and leaves: a parent, then all below its first child, and so on.

    Parameters
    ----------
    first, depth : (Q,) int64 arrays
        Code of each node's first voxel, and its depth.
    state : (Q,) array
        State of a leaf; the greatest state below an inner node.
    parent : (Q,) int64 array
        Where each node's parent is; the root is its own.
    leaf : (Q,) int64 array
        Which of the leaves each node is; -1 for an inner node.
    """

    first: NDArray[np.int64]
    depth: NDArray[np.int64]
    state: NDArray[Any]
    parent: NDArray[np.int64]
    leaf: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.first)

    @property
    def place(self) -> NDArray[np.int64]:
        """Number (Q,) of each node among its parent's eight children."""
        return np.asarray(self.first >> 3 * (DEPTH - self.depth) & 7)

    @property
    def children(self) -> NDArray[np.uint8]:
        """Mask (Q,) of each node's children."""
        return self.gathered(np.left_shift(1, self.place)).astype(np.uint8)

    def gathered(self, bits: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return for each node the sum (Q,) of a number that each of its children brings."""
        return np.bincount(self.parent[1:], bits[1:], minlength=len(self)).astype(np.int64)


def prune(
    voxels: tuple[NDArray[np.int64], NDArray[Any]],
    bricks: tuple[NDArray[np.int64], NDArray[Any]],
) -> Leaves:
    """Return the fewest leaves: eight children that are leaves of equal state become one (`pruneNode`).

    Parameters
    ----------
    voxels, bricks : pair of (M,) arrays
        Codes, ascending, and states of voxels, and of bricks whose voxels all have that state.
    """
    codes, states = voxels
    firsts, depths, found = [], [], []
    for depth in range(DEPTH, -1, -1):
        if depth == BRICK_DEPTH:
            codes, states = np.append(codes, bricks[0]), np.append(states, bricks[1])
            order = np.argsort(codes)
            codes, states = codes[order], states[order]
        heads = _alike(codes, states)
        alone = np.ones(len(codes), dtype=bool)
        alone[heads[:, None] + EIGHT] = False
        firsts.append(codes[alone] << 3 * (DEPTH - depth))
        depths.append(np.full(len(firsts[-1]), depth))
        found.append(states[alone])
        codes, states = codes[heads] >> 3, states[heads]
    return _in_order(np.concatenate(firsts), np.concatenate(depths), np.concatenate(found))


def joined(a: Leaves, b: Leaves) -> Leaves:
    """Return the leaves of both; they share no voxel."""
    return _in_order(np.append(a.first, b.first), np.append(a.depth, b.depth), np.append(a.state, b.state))


def nodes_of(leaves: Leaves) -> Nodes:
    """Return all nodes of the tree that has these leaves."""
    firsts, depths = [leaves.first], [leaves.depth]
    codes = leaves.first[:0]
    for depth in range(DEPTH, 0, -1):
        shift = 3 * (DEPTH - depth)
        codes = np.unique(np.append(codes, leaves.first[leaves.depth == depth] >> shift) >> 3)
        firsts.append(codes << shift + 3)
        depths.append(np.full(len(codes), depth - 1))
    first, deep = np.concatenate(firsts), np.concatenate(depths)
    rank = _rank(first, deep)
    order = np.argsort(rank)
    first, deep, rank = first[order], deep[order], rank[order]
    above = 3 * (DEPTH - deep + 1)
    parent = np.searchsorted(rank, _rank(first >> above << above, deep - 1))
    leaf = np.where(order < len(leaves), order, -1)
    return Nodes(first, deep, _greatest_below(leaves.state, deep, parent, leaf), parent, leaf)


def cells_at(leaves: Leaves, depth: int) -> tuple[NDArray[np.int64], NDArray[Any]]:
    """Return the codes, ascending, and states of the cells of a depth that make up leaves, none of them deeper."""
    size = np.left_shift(1, 3 * (depth - leaves.depth))
    begin = np.cumsum(size) - size
    codes = np.repeat((leaves.first >> 3 * (DEPTH - depth)) - begin, size) + np.arange(size.sum())
    return codes, np.repeat(leaves.state, size)


def unknown_leaves(leaves: Leaves) -> Leaves:
    """Return the largest cells that hold no voxel of any leaf; their state is 0."""
    if len(leaves) == 0:
        root = np.zeros(1, dtype=np.int64)
        return Leaves(root, root, np.zeros(1, dtype=leaves.state.dtype))
    nodes = nodes_of(leaves)
    inner = nodes.leaf < 0
    above, place = np.nonzero((nodes.children[inner, None] >> EIGHT & 1) == 0)
    depth = nodes.depth[inner][above] + 1
    first = nodes.first[inner][above] + np.left_shift(place, 3 * (DEPTH - depth))
    return _in_order(first, depth, np.zeros(len(first), dtype=leaves.state.dtype))


def greatest_within(
    leaves: Leaves, codes: NDArray[np.int64], depth: int
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the greatest state (M,) in the cell of a depth that holds each voxel, and where there is any.

    A leaf larger than the cell answers for it (`search`, with OctoMap's values of inner nodes).
    """
    shift = 3 * (DEPTH - depth)
    start = codes >> shift << shift
    size = np.left_shift(1, 3 * (DEPTH - leaves.depth))
    # the first leaf that ends after the cell starts, and the first that starts after the cell ends
    begin = np.searchsorted(leaves.first + size, start, side="right")
    end = np.searchsorted(leaves.first, start + (1 << shift))
    some = begin < end
    state = np.zeros(len(codes), dtype=leaves.state.dtype)
    if some.any():
        ranges = np.stack([begin[some], end[some]], axis=1).ravel()
        state[some] = np.maximum.reduceat(np.append(leaves.state, leaves.state[-1:]), ranges)[::2]
    return state, some


def _in_order(first: NDArray[np.int64], depth: NDArray[np.int64], state: NDArray[Any]) -> Leaves:
    order = np.argsort(first)
    return Leaves(first[order], depth[order], state[order])


def _rank(first: NDArray[np.int64], depth: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return numbers that put parents before their children and siblings in order."""
    return first * (DEPTH + 1) + depth


def _greatest_below(
    states: NDArray[Any],
    depth: NDArray[np.int64],
    parent: NDArray[np.int64],
    leaf: NDArray[np.int64],
) -> NDArray[Any]:
    """Return the state of each node from those of the leaves."""
    greatest = np.empty(len(depth), dtype=states.dtype)
    greatest[leaf >= 0] = states[leaf[leaf >= 0]]
    greatest[leaf < 0] = states.min(initial=0)
    for d in range(DEPTH, 0, -1):
        at = depth == d
        np.maximum.at(greatest, parent[at], greatest[at])
    return greatest


def _alike(codes: NDArray[np.int64], states: NDArray[Any]) -> NDArray[np.intp]:
    """Return where runs of eight siblings with equal states begin; codes ascend."""
    heads = np.flatnonzero((codes[:-7] & 7 == 0) & (codes[7:] - codes[:-7] == 7))
    eight = states[heads[:, None] + EIGHT]
    return np.asarray(heads[(eight == eight[:, :1]).all(axis=1)])
