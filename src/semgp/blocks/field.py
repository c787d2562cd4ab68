"""The field: sites, blocks and their posteriors, kept up to date cell by cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.blocks.answer import Answers, answer_pairs, answer_prior
from semgp.blocks.covariance import mixture
from semgp.blocks.layout import Layout, lay_out, neighbours
from semgp.blocks.link import Link
from semgp.blocks.model import BlockModel
from semgp.blocks.pairs import CellTrees, Pairs, cells_of, find_pairs
from semgp.blocks.sites import CELL, Sites
from semgp.blocks.solve import Noise, Solved, solve_cells
from semgp.cloud import LabelledCloud
from semgp.parallel import n_workers, parallel_map, slices

I32, I64 = NDArray[np.int32], NDArray[np.int64]

_QUERY_SLICE = 16_384
_WORK = 4_096  # pairs that one thread answers at a time


@dataclass
class Piece:
    """Cells that were solved together; the first of their blocks has the number `first`."""

    first: int
    solved: Solved
    live: int


class Field:
    """Sites and the posteriors of the blocks round them.

    Parameters
    ----------
    model : BlockModel
        What is fixed for the life of the map.
    n_classes : int
        C.
    """

    def __init__(self, model: BlockModel, n_classes: int) -> None:
        self.model = model
        self.sites = Sites(n_classes, model.n_features, model.resolution)
        self._kernel = mixture(model.kernel, 3 + model.n_features)
        prior = model.class_prior(n_classes)
        self._noise = Noise(model.s_n, model.nugget, model.a, prior, model.solves)
        self._link = Link(
            prior, prior ** np.float32(sum(model.weights)), np.float32(model.delta), np.float32(model.v_0),
            *(np.float32(w) for w in model.weights),
        )  # fmt: skip
        self.prior_variance = float(self._kernel.variance.sum())
        self._stale = np.empty(0, dtype=bool)
        self._block = np.empty(0, dtype=np.int64)
        self._depth = np.empty(0, dtype=np.int32)
        self._tree_at = np.empty(0, dtype=np.int64)
        self._piece = np.empty(0, dtype=np.int64)
        self._axes, self._cuts = np.empty(0, dtype=np.int8), np.empty(0, dtype=np.float32)
        self.pieces: dict[int, Piece] = {}
        self._next_block = 0

    def add(
        self,
        points: NDArray[np.float64],
        labels: NDArray[np.int32] | None,
        weights: NDArray[np.float32] | None,
        features: NDArray[np.float32],
    ) -> None:
        """Add labelled points; the blocks that they reach are solved again when next needed."""
        touched = self.sites.add(points, labels, weights, features)
        self._grow()
        if len(touched):
            around = neighbours(self.sites, touched)
            self._stale[around[around >= 0]] = True

    def add_cloud(self, cloud: LabelledCloud) -> None:
        """Add the labelled points of a cloud."""
        part = cloud if cloud.labelled.all() else cloud[cloud.labelled]
        weights = None if part.labels is not None else part.class_weights
        self.add(part.points, part.labels, weights, self.features(part))

    def features(self, cloud: LabelledCloud) -> NDArray[np.float32]:
        """Return the inputs (N, F) beyond position that the model asks for."""
        return np.empty((len(cloud), 0), dtype=np.float32)

    def block_of(self, points: NDArray[np.float64], solve: bool = False) -> tuple[I64, NDArray[np.float32]]:
        """Return the block (M,) whose leaf each point lies in, -1 for none, and the place (M, 3) in its cell."""
        pairs = self._pairs(points, 1e-6, solve)
        first = np.flatnonzero(pairs.rank == 0)
        return pairs.block[first], pairs.local[first]

    def piece_of(self, block: int) -> Piece:
        """Return the piece that holds a block."""
        return self.pieces[max(first for first in self.pieces if first <= block)]

    def solve(self, cells: I32 | None = None) -> int:
        """Bring cells, all of them by default, up to date, and return how many were solved."""
        stale = np.flatnonzero(self._stale if cells is None else self._stale[cells])
        todo = stale if cells is None else cells[stale]
        if not len(todo):
            return 0
        sites, model = self.sites, self.model
        todo = todo[np.argsort(sites.cells.keys[todo])].astype(np.int32)
        around = neighbours(sites, todo)
        involved = np.unique(around[around >= 0])
        involved = involved[np.argsort(sites.cells.keys[involved])].astype(np.int32)
        layout = lay_out(sites, involved)
        place = np.full(len(sites.cells), -1, dtype=np.int32)
        place[involved] = np.arange(len(involved))
        places = place[todo].astype(np.int64)
        local = np.full((len(involved), 27), -1, dtype=np.int32)
        local[places] = np.where(around >= 0, place[around], -1)
        depth = _depths(sites.size[todo], model.leaf)
        leaves = 1 << depth.astype(np.int64)
        block_at = np.concatenate([[0], leaves.cumsum()]) + self._next_block
        tree_at = np.concatenate([[0], (leaves - 1).cumsum()]) + len(self._axes)
        axes = np.empty(tree_at[-1] - len(self._axes), dtype=np.int8)
        cuts = np.empty(len(axes), dtype=np.float32)

        def run(part: slice) -> Solved:
            return solve_cells(
                layout, places[part], local, CELL * sites.resolution, model.sizes, self._kernel, self._noise,
                tree_at[part] - len(self._axes), axes, cuts, block_at[part.start : part.stop + 1],
            )  # fmt: skip

        parts = _even_slices(leaves)
        for part, solved in zip(parts, parallel_map(run, parts)):
            first = int(block_at[part.start])
            self.pieces[first] = Piece(first, solved, part.stop - part.start)
            for piece in self._piece[todo[part]][self._block[todo[part]] >= 0]:
                self._release(int(piece))
            self._piece[todo[part]] = first
        self._axes, self._cuts = np.concatenate([self._axes, axes]), np.concatenate([self._cuts, cuts])
        self._block[todo], self._tree_at[todo], self._depth[todo] = block_at[:-1], tree_at[:-1], depth
        self._next_block = int(block_at[-1])
        self._stale[todo] = False
        return len(todo)

    def query(self, points: NDArray[np.float64], features: NDArray[np.float32]) -> Answers:
        """Answer at points (M, 3); the blocks that they lie in are brought up to date first."""
        pairs = self._pairs(points, self.model.blend / 2, solve=True)
        M, C = len(points), self.sites.mass.shape[1]
        answers = Answers(
            np.zeros((M, C), np.float32), np.zeros((M, C), np.float32), np.zeros(M, np.float32)
        )
        for turn in self._turns(pairs):
            parallel_map(lambda job: self._answer(job, pairs, features, answers), turn)
        return answers

    def _pairs(self, points: NDArray[np.float64], half: float, solve: bool) -> Pairs:
        """Return the pairs of points, with boxes of 2 * half voxels; solve the cells that they need, or not."""
        sites = self.sites
        assert sites.origin is not None
        origin, parts = sites.origin.astype(np.float64), list(slices(len(points), _QUERY_SLICE))
        if solve:
            found = parallel_map(
                lambda s: np.unique(cells_of(points[s], sites.resolution, origin, half)), parts
            )
            self.solve(self._cells_near(np.unique(np.concatenate(found))))
        trees = CellTrees(
            sites.cells.slots, sites.cells.keys, self._block, self._depth, self._tree_at, self._axes, self._cuts
        )
        chunks = parallel_map(
            lambda s: find_pairs(points[s], s.start, sites.resolution, origin, half, trees), parts
        )
        return Pairs(*(np.concatenate(columns) for columns in zip(*chunks)))

    def _answer(
        self, job: tuple[int, I64], pairs: Pairs, features: NDArray[np.float32], answers: Answers
    ) -> None:
        first, order = job
        if first < 0:
            answer_prior(pairs, order, self.prior_variance, self._link, answers)
        else:
            answer_pairs(
                self.pieces[first].solved, first, pairs, order, features, self._kernel, self._link, answers
            )

    def _turns(self, pairs: Pairs) -> list[list[tuple[int, I64]]]:
        """Split the pairs into turns that meet no point twice, and each turn into jobs of one piece."""
        firsts = np.array(sorted(self.pieces), dtype=np.int64)
        low = pairs.block.min()
        key = pairs.rank.astype(np.int64) * (self._next_block - low + 1) + pairs.block - low
        order = np.argsort(key, kind="stable")
        rank, block = pairs.rank[order], pairs.block[order]
        turns = []
        for r in range(int(rank[-1]) + 1):
            a, b = np.searchsorted(rank, [r, r + 1])
            edges = a + np.searchsorted(block[a:b], np.append(firsts, self._next_block))
            jobs = [(-1, order[a : edges[0]])] if edges[0] > a else []
            for i in range(len(firsts)):
                for s in slices(int(edges[i + 1] - edges[i]), _WORK):
                    jobs.append((int(firsts[i]), order[edges[i] + s.start : edges[i] + s.stop]))
            turns.append(jobs)
        return turns

    def _cells_near(self, keys: I64) -> I32:
        """Return the cells of keys that hold sites or have a neighbour that does; empty ones are made known."""
        ids = self.sites.cells.find(keys)
        missing = keys[ids < 0]
        if len(missing):
            known = len(self.sites.cells)
            near = self._near_sites(missing)
            self.sites.cell_ids(missing[near])
            self._grow()
            self._stale[known:] = True
            ids = self.sites.cells.find(keys)
        return ids[ids >= 0].astype(np.int32)

    def _near_sites(self, keys: I64) -> NDArray[np.bool_]:
        from semgp.blocks.layout import around_keys

        around = self.sites.cells.find(around_keys(keys).ravel()).reshape(-1, 27)
        size = np.append(self.sites.size, 0)
        return np.asarray((size[around] > 0).any(axis=1))

    def _grow(self) -> None:
        n, new = len(self._stale), len(self.sites.cells) - len(self._stale)
        if new > 0:
            self._stale = np.append(self._stale, np.zeros(new, dtype=bool))
            self._block = np.append(self._block, np.full(new, -1))
            self._piece = np.append(self._piece, np.full(new, -1))
            self._depth = np.append(self._depth, np.zeros(new, dtype=np.int32))
            self._tree_at = np.append(self._tree_at, np.zeros(new, dtype=np.int64))
        assert len(self._stale) >= n

    def _release(self, first: int) -> None:
        piece = self.pieces[first]
        piece.live -= 1
        if piece.live == 0:
            del self.pieces[first]


def _even_slices(leaves: I64) -> list[slice]:
    """Slices of cells with about as many blocks each, a few for each thread."""
    total = leaves.cumsum()
    wanted = min(len(leaves), 4 * n_workers())
    cuts = np.unique(np.searchsorted(total, np.linspace(0, total[-1], wanted + 1)[1:-1], side="right"))
    edges = np.unique(np.concatenate([[0], cuts, [len(leaves)]]))
    return [slice(int(a), int(b)) for a, b in zip(edges[:-1], edges[1:])]


@njit(cache=True)
def _depths(sizes: I32, leaf: int) -> I32:
    depth = np.zeros(len(sizes), np.int32)
    for i in range(len(sizes)):
        while sizes[i] > leaf << depth[i]:
            depth[i] += 1
    return depth
