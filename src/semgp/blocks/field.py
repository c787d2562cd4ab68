"""The field: sites, blocks and their posteriors, kept up to date cell by cell, and asked at points."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.answer import Answers, answer_pairs, answer_prior, prior_probabilities
from semgp.blocks.arrays import F32, F64, I32, I64
from semgp.blocks.cells import CELL, cell_keys
from semgp.blocks.covariance import mixture
from semgp.blocks.expert_answer import answer_by_experts
from semgp.blocks.layout import around_keys, lay_out, neighbours
from semgp.blocks.model import CLOSED, EXPERTS, BlockModel
from semgp.blocks.observations import Observations, require_summable
from semgp.blocks.pairs import CellTrees, find_pairs, home_blocks, mark_cells
from semgp.blocks.sites import Sites
from semgp.blocks.solve_cells import solve_cells
from semgp.blocks.solved import Solved
from semgp.blocks.store import BlockStore, sorted_by
from semgp.errors import InputError
from semgp.parallel import n_workers, parallel_map, slices

_SLICE = 16_384
_JOB = 4_096  # points that one thread answers at a time


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
        self._changed = np.empty(0, dtype=bool)
        self._kernel = mixture(model.kernel, model.n_dims)
        self._noise, self._link = model.noise(n_classes), model.link(n_classes)
        pooled = model.posterior not in EXPERTS
        self._unknown = prior_probabilities(self._link, n_classes) if pooled else self._link.prior
        self.prior_variance = float(self._kernel.variance.sum())

    def require_usable(self, given: Observations) -> None:
        """Raise InputError for numbers beyond what a site can hold, or uncertain positions for experts."""
        require_summable(given)
        if given.variances is not None and self.model.posterior in EXPERTS:
            raise InputError(
                f"blocks of {self.model.posterior} experts take positions as certain: leave covariances out, or "
                f"use one of {', '.join(CLOSED)}."
            )

    def add(self, given: Observations) -> None:
        """Add labelled points; the blocks that they reach are solved again when next needed.

        Raises
        ------
        InputError
            Points a million voxels from the first, or what `require_usable` refuses.
        """
        self.require_usable(given)
        self.touch(self.sites.add(given))

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take in sites that `Sites.to_arrays` gave, of cells that have none so far.

        Raises
        ------
        InputError
            Sites that are damaged.
        """
        new = self.sites.restore(arrays)
        self.store.grow(len(self.sites.cells), stale=False)
        self.store.stale[new] = True

    def touch(self, cells: I32) -> None:
        """Have cells that have changed, and those round about, solved again when next needed."""
        n = len(self.sites.cells)
        self.store.grow(n, stale=False)
        if len(cells):
            around = neighbours(self.sites, cells)
            self.store.stale[around[around >= 0]] = True
            self._changed = np.append(self._changed, np.zeros(n - len(self._changed), dtype=bool))
            self._changed[cells] = True

    def take_changed(self) -> I64:
        """Return the keys of the cells that were touched since this was last asked."""
        keys = self.sites.cells.keys[np.flatnonzero(self._changed)]
        self._changed = np.zeros(len(self.sites.cells), dtype=bool)
        return keys

    def only(self, cells: I32) -> Field:
        """Return the field of some of the cells, with their blocks as they are."""
        made = Field(self.model, self._n_classes)
        chosen = self.sites.cells.keys[cells]
        arrays = self.sites.only(np.isin(cell_keys(self.sites.voxels.keys), chosen))
        if "time" in arrays:
            arrays |= {"cells": chosen, "time": np.append(arrays["time"][cells], arrays["time"][-1])}
        made.sites.restore(arrays)
        made.sites.origin, made.sites.clock = self.sites.origin, self.sites.clock
        made.sites.cell_ids(chosen)
        old = self.sites.cells.find(made.sites.cells.keys)
        made.sites.drift[: len(old)] = self.sites.drift[old]
        made.store = self.store.only(old)
        return made

    def solve(self, cells: I32 | None = None, tolerance: float = 0.0) -> int:
        """Bring cells, all of them by default, up to date, and return how many had to be solved.

        With a tolerance, cells stay as they are whose sites have drifted less than that on average, see `Sites`.
        """
        sites, store = self.sites, self.store
        cells = np.arange(len(sites.cells), dtype=np.int32) if cells is None else cells
        todo = cells[store.stale[cells]]
        if tolerance > 0:
            moved = (sites.drift[todo] > tolerance * sites.size[todo]) | (sites.size[todo] == 0)
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

        parts = _even_slices(leaves)
        T = self.model.members
        factor_size = T * (T + 1) // 2 if self._noise.solve else 0
        rooms = [store.room(int(leaves[part].sum()) * factor_size) for part in parts]

        def run(part: slice, room: F32) -> Solved:
            return solve_cells(
                layout, place[todo[part]].astype(np.int64), place[around[part]], CELL * sites.resolution,
                self.model.sizes(), self._kernel, self._noise, leaves[part], tree_at[part], axes, cuts,
                room,
            )  # fmt: skip

        solved = parallel_map(lambda job: run(*job), zip(parts, rooms, strict=True))
        sites.drift[todo] = 0
        store.replace(todo, leaves, block_at, parts, solved, axes, cuts)
        return len(todo)

    def query(self, points: F64, features: F32, tolerance: float = 0.0) -> Answers:
        """Answer at points (M, 3) with features (M, F), NaN where unknown; stale blocks are solved first."""
        if not len(self.sites):
            nothing = np.broadcast_to(self._unknown[: self._n_classes], (len(points), self._n_classes))
            return Answers(nothing, np.full(len(points), self.prior_variance, np.float32))
        half = self.model.blend / 2
        self._solve_round(points, half, tolerance)
        origin, trees = self._origin(), self.store.trees(self.sites.cells)
        answers = Answers(np.zeros((len(points), self._n_classes), np.float32), np.zeros(len(points), np.float32))

        def run(chosen: I64) -> None:
            pairs = find_pairs(points, chosen, self.sites.resolution, origin, half, trees)
            for piece, order, block in self.store.by_piece(pairs.block):
                if piece is None:
                    answer_prior(pairs, order, self.prior_variance, self._unknown, answers)
                elif self.model.posterior in EXPERTS:
                    answer_by_experts(self.model, piece, pairs, order, block, features, self._link.prior, answers)
                else:
                    answer_pairs(piece.solved, pairs, order, block, features, self._kernel, self._link, answers)

        # points of one block come together, and one thread answers each point
        order = sorted_by(self._home(points, trees)[0])
        parallel_map(run, [order[s] for s in slices(len(points), _JOB)])
        return answers

    def home(self, points: F64, solve: bool = False) -> tuple[I64, F32]:
        """Return the block (M,) in whose leaf each point lies, -1 for none, and its place (M, 3) in the cell."""
        if solve:
            self._solve_round(points, 0.0, 0.0)
        return self._home(points, self.store.trees(self.sites.cells))

    def _home(self, points: F64, trees: CellTrees) -> tuple[I64, F32]:
        origin = self._origin()
        block, local = np.empty(len(points), np.int64), np.empty((len(points), 3), np.float32)

        def run(s: slice) -> None:
            home_blocks(points[s], self.sites.resolution, origin, trees, block[s], local[s])

        parallel_map(run, slices(len(points), _SLICE))
        return block, local

    def _solve_round(self, points: F64, half: float, tolerance: float) -> None:
        """Solve the stale cells that boxes round points overlap."""
        sites, origin = self.sites, self._origin()
        needed = np.zeros(len(sites.cells), dtype=bool)
        table = sites.cells.slots, sites.cells.keys, needed
        unknown = parallel_map(
            lambda s: mark_cells(points[s], sites.resolution, origin, half, *table), slices(len(points), _SLICE)
        )
        empty = self._empty_cells(np.unique(np.concatenate([*unknown, np.empty(0, np.int64)])))
        self.solve(np.concatenate([np.flatnonzero(needed).astype(np.int32), empty]), tolerance)

    def _origin(self) -> F64:
        assert self.sites.origin is not None, "a field without sites cannot be asked"
        return self.sites.origin.astype(np.float64)

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
