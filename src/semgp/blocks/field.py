"""The field: sites, blocks and their posteriors, kept up to date cell by cell, and asked at points."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from semgp.blocks.answer import Answers, answer_pairs, answer_prior
from semgp.blocks.arrays import F32, F64, I32, I64
from semgp.blocks.covariance import mixture
from semgp.blocks.expert_answer import answer_by_experts
from semgp.blocks.layout import around_keys, lay_out, neighbours
from semgp.blocks.model import EXPERTS, BlockModel
from semgp.blocks.pairs import Pairs, find_pairs, mark_cells
from semgp.blocks.sites import CELL, Sites
from semgp.blocks.solve import Solved, solve_cells
from semgp.blocks.store import BlockStore, Piece
from semgp.parallel import n_workers, parallel_map, slices

_QUERY_SLICE = 16_384
_JOB = 4_096  # pairs that one thread answers at a time


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
        model.fits(n_classes)
        self.model = model
        self.sites = Sites(n_classes + model.other, len(model.features), model.resolution)
        self._n_classes = n_classes
        self.store = BlockStore()
        self._kernel = mixture(model.kernel, model.n_dims)
        self._noise, self._link = model.noise(n_classes), model.link(n_classes)
        self.prior_variance = float(self._kernel.variance.sum())

    def add(self, points: F64, labels: I32 | None, weights: F32 | None, features: F32) -> None:
        """Add labelled points; the blocks that they reach are solved again when next needed.

        Raises
        ------
        InputError
            Points a million voxels from the first.
        """
        touched = self.sites.add(points, labels, weights, features)
        self.touch(touched)

    def touch(self, cells: I32) -> None:
        """Have cells and those round about solved again when next needed."""
        self.store.grow(len(self.sites.cells), stale=False)
        if len(cells):
            around = neighbours(self.sites, cells)
            self.store.stale[around[around >= 0]] = True

    def solve(self, cells: I32 | None = None, tolerance: float = 0.0) -> int:
        """Bring cells, all of them by default, up to date, and return how many had to be solved.

        With a tolerance, cells stay as they are whose sites have drifted less than that on average, see `Sites`.
        """
        sites, store = self.sites, self.store
        cells = np.arange(len(sites.cells), dtype=np.int32) if cells is None else cells
        todo = cells[store.stale[cells]]
        if tolerance > 0:
            moved = sites.drift[todo] > tolerance * sites.size[todo]
            todo = todo[moved | ~store.is_solved(todo)]
        if not len(todo):
            return 0
        todo = todo[np.argsort(sites.cells.keys[todo])]
        around = neighbours(sites, todo)
        involved = np.unique(around[around >= 0]).astype(np.int32)
        layout = lay_out(sites, involved[np.argsort(sites.cells.keys[involved])])
        place = np.full(len(sites.cells) + 1, -1, dtype=np.int32)  # the last: no cell
        place[layout.cells] = np.arange(len(involved))
        leaves = np.maximum(1, -(-sites.size[todo] // self.model.leaf)).astype(np.int64)
        block_at = store.next_block + np.concatenate([[0], leaves.cumsum()])
        tree_at = np.concatenate([[0], (leaves - 1).cumsum()])
        axes, cuts = np.empty(tree_at[-1], dtype=np.int8), np.empty(tree_at[-1], dtype=np.float32)

        def run(part: slice) -> Solved:
            return solve_cells(
                layout, place[todo[part]].astype(np.int64), place[around[part]], CELL * sites.resolution,
                self.model.sizes(), self._kernel, self._noise, leaves[part], tree_at[part], axes, cuts,
            )  # fmt: skip

        parts = _even_slices(leaves)
        sites.drift[todo] = 0
        store.replace(todo, leaves, block_at, parts, parallel_map(run, parts), axes, cuts)
        return len(todo)

    def query(self, points: F64, features: F32, tolerance: float = 0.0) -> Answers:
        """Answer at points (M, 3) with features (M, F), NaN where unknown; stale blocks are solved first."""
        pairs = self.pairs(points, self.model.blend / 2, tolerance=tolerance)
        M, C = len(points), self._n_classes
        answers = Answers(np.zeros((M, C), np.float32), np.zeros((M, C), np.float32), np.zeros(M, np.float32))

        def run(job: tuple[Piece | None, I64]) -> None:
            piece, order = job
            if piece is None:
                answer_prior(pairs, order, self.prior_variance, self._link, answers)
            elif self.model.posterior in EXPERTS:
                answer_by_experts(self.model, piece, pairs, order, features, self._link.prior, answers)
            else:
                answer_pairs(piece.solved, piece.first, pairs, order, features, self._kernel, self._link, answers)

        # a point's first pair in the first turn, its second in the second: no two threads add to one point
        for turn in range(int(pairs.rank.max(initial=-1)) + 1):
            mine = np.flatnonzero(pairs.rank == turn)
            order = mine[np.argsort(pairs.block[mine], kind="stable")]
            parallel_map(run, self.store.jobs(pairs.block[order], order, _JOB))
        return answers

    def pairs(self, points: F64, half: float, solve: bool = True, tolerance: float = 0.0) -> Pairs:
        """Return which blocks answer points (M, 3), with boxes of 2 * half voxels; solve stale ones, or not."""
        sites, parts = self.sites, list(slices(len(points), _QUERY_SLICE))
        assert sites.origin is not None, "a field without sites cannot be asked"
        origin = sites.origin.astype(np.float64)
        if solve:
            needed = np.zeros(len(sites.cells), dtype=bool)
            table = sites.cells.slots, sites.cells.keys, needed
            unknown = parallel_map(lambda s: mark_cells(points[s], sites.resolution, origin, half, *table), parts)
            empty = self._empty_cells(np.unique(np.concatenate([*unknown, np.empty(0, np.int64)])))
            self.solve(np.concatenate([np.flatnonzero(needed).astype(np.int32), empty]), tolerance)
        trees = self.store.trees(sites.cells)
        found_pairs = parallel_map(
            lambda s: find_pairs(points[s], s.start, sites.resolution, origin, half, trees), parts or [slice(0, 0)]
        )
        return Pairs(*(np.concatenate(columns) for columns in zip(*found_pairs)))

    def _empty_cells(self, keys: I64) -> I32:
        """Return new cells, without sites, for those keys that have a cell with sites round about."""
        around = self.sites.cells.find(around_keys(keys).ravel()).reshape(-1, 27)
        size = np.append(self.sites.size, 0)
        empty = self.sites.cell_ids(keys[(size[around] > 0).any(axis=1)])
        self.store.grow(len(self.sites.cells), stale=True)
        return empty


def _even_slices(leaves: I64) -> list[slice]:
    """Slices of cells with about as many blocks each, a few for each thread."""
    total = leaves.cumsum()
    wanted = min(len(leaves), 4 * n_workers())
    cuts = np.searchsorted(total, np.linspace(0, total[-1], wanted + 1)[1:-1], side="right")
    edges = np.unique(np.concatenate([[0], cuts, [len(leaves)]]))
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]
