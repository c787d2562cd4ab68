"""Solved blocks: which cell has which, their trees, and the pieces in which they were solved."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from semgp.blocks.arrays import F32, I8, I32, I64, Bool
from semgp.blocks.experts import BlockExpert
from semgp.blocks.pairs import CellTrees
from semgp.blocks.solved import Solved, taken
from semgp.voxels import VoxelTable


@dataclass
class Piece:
    """Cells that one thread solved together.

    Parameters
    ----------
    first : int
        The piece's name: how many blocks had been solved before.
    solved : Solved
        Their posteriors.
    cells : int
        How many of the map's cells have their blocks here; the piece is dropped when there are none.
    experts : dict
        Posteriors that blocks solve by themselves, made when first asked for.
    """

    first: int
    solved: Solved
    cells: int
    experts: dict[int, BlockExpert] = field(default_factory=dict)


_MOST_SPARE = 64  # arrays of dropped pieces that are kept for the next ones


class Numbers(NamedTuple):
    """Blocks in the order of their cells' keys, whatever the order in which they were solved.

    start (n,): number of the first block of each solved cell, ascending. piece (n,): the piece it is in. inside
    (n,): its place there.
    """

    start: I64
    piece: I64
    inside: I64


class BlockStore:
    """The blocks of the cells.

    Blocks are numbered by place, from `trees` to the next `replace`: the order in which points are answered, and
    with it the last bit, does not depend on the map's history.
    """

    def __init__(self) -> None:
        self.stale = np.empty(0, dtype=bool)
        self.pieces: dict[int, Piece] = {}
        self.next_block = 0
        self._spare: list[F32] = []
        self._numbers = Numbers(*(np.empty(0, dtype=np.int64) for _ in range(3)))
        self._block, self._tree_at = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        self._leaves, self._piece = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        self._axes, self._cuts = np.empty(0, dtype=np.int8), np.empty(0, dtype=np.float32)

    def grow(self, n_cells: int, stale: bool) -> None:
        """Make room for cells that were not known before."""
        new = n_cells - len(self.stale)
        if new > 0:
            self.stale = np.append(self.stale, np.full(new, stale))
            self._block = np.append(self._block, np.full(new, -1))
            self._piece = np.append(self._piece, np.full(new, -1))
            self._tree_at = np.append(self._tree_at, np.zeros(new, dtype=np.int64))
            self._leaves = np.append(self._leaves, np.zeros(new, dtype=np.int64))

    def replace(
        self,
        cells: I32,
        leaves: I64,
        block_at: I64,
        parts: Sequence[slice],
        solved: Sequence[Solved],
        axes: I8,
        cuts: F32,
    ) -> None:
        """Take in cells that were solved, in parts; what they had before is dropped."""
        for part, piece in zip(parts, solved):
            first = int(block_at[part.start])
            for old in self._piece[cells[part]]:
                self._release(int(old))
            self.pieces[first] = Piece(first, piece, part.stop - part.start)
            self._piece[cells[part]] = first
        self._block[cells], self._leaves[cells] = block_at[:-1], leaves
        self._compact_trees(cells)
        self._tree_at[cells] = len(self._axes) + np.concatenate([[0], (leaves - 1).cumsum()[:-1]])
        self._axes, self._cuts = np.concatenate([self._axes, axes]), np.concatenate([self._cuts, cuts])
        self.next_block = int(block_at[-1])
        self.stale[cells] = False
        self._shrink_pieces()

    def only(self, cells: I64) -> BlockStore:
        """Return the blocks of some of the cells, which get new ids: their places in `cells`."""
        made = BlockStore()
        made.stale, made._block, made._piece = self.stale[cells], self._block[cells], self._piece[cells]
        made._tree_at, made._leaves = self._tree_at[cells], self._leaves[cells]
        made._axes, made._cuts, made.next_block = self._axes, self._cuts, self.next_block
        firsts, used = np.unique(made._piece[made._piece >= 0], return_counts=True)
        made.pieces = {f: replace(self.pieces[f], cells=n) for f, n in zip(firsts.tolist(), used.tolist())}
        made._spare = self._spare
        made._shrink_pieces()
        return made

    def is_solved(self, cells: I32) -> Bool:
        """Return which cells have blocks, up to date or not."""
        return np.asarray(self._block[cells] >= 0)

    def trees(self, cells: VoxelTable) -> CellTrees:
        """Number the blocks, and return what compiled code needs to find those of points."""
        solved = np.flatnonzero(self._block >= 0)
        solved = solved[np.argsort(cells.keys[solved])]
        start = np.concatenate([[0], self._leaves[solved].cumsum()[:-1]]) if len(solved) else np.empty(0, np.int64)
        piece = self._piece[solved]
        self._numbers = Numbers(start.astype(np.int64), piece, self._block[solved] - piece)
        number = np.full(len(self._block), -1)
        number[solved] = start
        return CellTrees(cells.slots, cells.keys, number, self._leaves, self._tree_at, self._axes, self._cuts)

    def by_piece(self, block: I64) -> Iterator[tuple[Piece | None, I64, I64]]:
        """Sort pairs (n,) by the number of their block, and split them where another piece begins.

        Yields the piece, None where there is no block; pairs; and the place of their blocks in the piece.
        """
        order = sorted_by(block)
        block = block[order]
        unknown = int(np.searchsorted(block, 0))
        if unknown > 0:
            yield None, order[:unknown], block[:unknown]
        order, block = order[unknown:], block[unknown:]
        cell = np.searchsorted(self._numbers.start, block, side="right") - 1
        piece = self._numbers.piece[cell]
        inside = self._numbers.inside[cell] + block - self._numbers.start[cell]
        for a, b in pairwise([0, *(np.flatnonzero(np.diff(piece)) + 1).tolist(), len(order)]):
            if b > a:
                yield self.pieces[int(piece[a])], order[a:b], inside[a:b]

    @property
    def n_blocks(self) -> int:
        """Number of blocks that are in use."""
        return int(self._leaves[self._block >= 0].sum())

    @property
    def n_bytes(self) -> int:
        """Bytes of all posteriors and trees."""
        solved = sum(a.nbytes for piece in self.pieces.values() for a in piece.solved)
        return solved + self._axes.nbytes + self._cuts.nbytes

    def room(self, n: int) -> F32:
        """Return an array of n numbers, of any value, from a piece that was dropped where there is one.

        Fresh memory takes longer to touch than a factor to compute.
        """
        fits = [i for i, spare in enumerate(self._spare) if n <= len(spare) <= 2 * n]
        return self._spare.pop(fits[0]) if fits else np.empty(n, dtype=np.float32)

    def _release(self, first: int) -> None:
        if first >= 0:
            self.pieces[first].cells -= 1
            if self.pieces[first].cells == 0:
                self._spare = [*self._spare[-_MOST_SPARE:], self.pieces.pop(first).solved.factor]

    def _shrink_pieces(self) -> None:
        """Copy what is in use of pieces that have more blocks of no use than others."""
        solved = np.flatnonzero(self._block >= 0)
        firsts = np.array(sorted(self.pieces))
        place = np.searchsorted(firsts, self._piece[solved])
        used = np.bincount(place, self._leaves[solved], len(firsts)).astype(np.int64)
        for first, n in zip(firsts.tolist(), used.tolist()):
            piece = self.pieces[first]
            if 2 * n >= len(piece.solved.n):
                continue
            mine = solved[self._piece[solved] == first]
            mine = mine[np.argsort(self._block[mine])]
            starts, sizes = self._block[mine] - first, self._leaves[mine]
            keep = np.concatenate([np.arange(a, a + k) for a, k in zip(starts, sizes)])
            self._block[mine] = first + np.concatenate([[0], sizes.cumsum()[:-1]])
            self.pieces[first] = Piece(first, taken(piece.solved, keep), len(mine))

    def _compact_trees(self, dropped: I32) -> None:
        """Rewrite the trees without those of `dropped` cells once more than half of them are of no use."""
        keep = self._block >= 0
        keep[dropped] = False
        cells = np.flatnonzero(keep)
        sizes = self._leaves[cells] - 1
        total = int(sizes.sum())
        if 2 * total >= len(self._axes):
            return
        starts = np.concatenate([[0], sizes.cumsum()[:-1]]).astype(np.int64)
        source = np.repeat(self._tree_at[cells] - starts, sizes) + np.arange(total)
        self._axes, self._cuts = self._axes[source], self._cuts[source]
        self._tree_at[cells] = starts


def sorted_by(number: I64) -> I64:
    """Return the stable order of numbers (n,), sixteen bits at a time: numpy sorts those by radix."""
    left = number - number.min(initial=0)
    order = np.argsort((left & 0xFFFF).astype(np.uint16), kind="stable")
    while left.max(initial=0) > 0xFFFF:
        left >>= 16
        order = order[np.argsort((left[order] & 0xFFFF).astype(np.uint16), kind="stable")]
    return order
