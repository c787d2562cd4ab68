"""The log-odds of all known voxels, brick by brick."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.maps.settings import stored_array
from semgp.octomap import brick_kernels as kernels
from semgp.octomap.brick_kernels import Store
from semgp.octomap.index import CodeIndex, require_ascending, room_for
from semgp.octomap.morton import BRICK_BITS, BRICK_DEPTH, DEPTH
from semgp.octomap.rays import Sighting
from semgp.octomap.sensor import SensorModel, log_odds
from semgp.octomap.tree import Leaves, cells_at

FULL = np.uint64(2**64 - 1)
"""Mask of a brick whose voxels are all known."""


class Bricks:
    """Bricks of 4 x 4 x 4 voxels.

    A brick has a mask of the voxels known and, while all of those have the same log-odds, one value; else it
    owns a block of 64 values. So what OctoMap's tree gains by pruning is gained here too: free space, and the
    rim of what is known, cost a few bytes a brick.
    """

    def __init__(self) -> None:
        self._index = CodeIndex()
        self._store = Store(
            known=np.zeros(0, dtype=np.uint64),
            value=np.zeros(0, dtype=np.float32),
            block=np.zeros(0, dtype=np.int32),
            blocks=np.zeros((0, 64), dtype=np.float32),
            owner=np.zeros(0, dtype=np.int64),
        )
        self._n_blocks = 0

    def __len__(self) -> int:
        return len(self._index)

    @property
    def n_voxels(self) -> int:
        """Number of known voxels."""
        return int(np.bitwise_count(self._store.known).sum())

    @property
    def n_bytes(self) -> int:
        """Memory held, in bytes."""
        return self._index.n_bytes + sum(array.nbytes for array in self._store)

    def integrate(self, seen: Sighting, model: SensorModel) -> None:
        """Add a hit or a miss to the log-odds of each voxel that was seen, and clamp (`updateNode`)."""
        rows = self._rows(seen.bricks)
        self._store, self._n_blocks = kernels.integrate(
            rows,
            seen.free,
            seen.hit,
            log_odds(model.miss),
            log_odds(model.hit),
            log_odds(model.clamp_min),
            log_odds(model.clamp_max),
            self._store,
            self._n_blocks,
        )

    def find(self, codes: NDArray[np.int64]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Return the log-odds (M,) of voxels and whether they are known; unknown ones have 0."""
        rows = self._index.find(codes >> BRICK_BITS)
        values = np.zeros(len(codes), dtype=np.float32)
        known = np.zeros(len(codes), dtype=np.bool_)
        kernels.find(codes, rows, self._store, values, known)
        return values, known

    def solid(self) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Return the codes, ascending, and the log-odds of bricks known throughout that have one value."""
        rows = self._ordered(self._is_solid)
        return self._index.codes[rows], self._store.value[rows]

    def voxels(self, *, of_solid: bool = True) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """Return the codes, ascending, and log-odds of known voxels: all, or those of bricks not `solid`."""
        rows = self._ordered(of_solid | ~self._is_solid)
        n = int(np.bitwise_count(self._store.known[rows]).sum())
        codes, values = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.float32)
        kernels.list_voxels(rows, self._index.codes, self._store, codes, values)
        return codes, values

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return arrays, bricks in the order of their codes, from which `from_arrays` makes the same bricks."""
        rows = self._ordered(np.ones(len(self), dtype=bool))
        block = self._store.block[rows]
        return {
            "bricks": self._index.codes[rows],
            "known": self._store.known[rows],
            "log_odds": np.where(block == 0, self._store.value[rows], np.float32(0)),
            "mixed_bricks": np.flatnonzero(block),
            "mixed_log_odds": self._store.blocks[block[block > 0] - 1],
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the bricks again from what `to_arrays` gave.

        Raises
        ------
        InputError
            Arrays that are missing, damaged or do not fit together.
        """
        codes = stored_array(arrays, "bricks", np.int64, (None,))
        mixed = stored_array(arrays, "mixed_bricks", np.int64, (None,))
        known = stored_array(arrays, "known", np.uint64, (len(codes),))
        value = stored_array(arrays, "log_odds", np.float32, (len(codes),))
        blocks = stored_array(arrays, "mixed_log_odds", np.float32, (len(mixed), 64))
        require_ascending("bricks", codes, 1 << 3 * BRICK_DEPTH)
        require_ascending("mixed_bricks", mixed, len(codes))
        if not (np.isfinite(value).all() and np.isfinite(blocks).all() and known.all()):
            raise InputError("the stored map has bricks without known voxels, or log-odds that are not finite.")
        made = cls()
        made._rows(codes)
        made._store.block[mixed] = np.arange(1, len(mixed) + 1)
        made._store = Store(known.copy(), value.copy(), made._store.block, blocks.copy(), mixed.copy())
        made._n_blocks = len(mixed)
        return made

    @classmethod
    def from_leaves(cls, leaves: Leaves) -> Self:
        """Make bricks from leaves whose states are log-odds."""
        made = cls()
        small = leaves.depth > BRICK_DEPTH
        codes, values = cells_at(leaves[small], DEPTH)
        made._assign(codes, values)
        codes, values = cells_at(leaves[~small], BRICK_DEPTH)
        rows = made._rows(codes)
        made._store.known[rows] = FULL
        made._store.value[rows] = values
        return made

    def trim(self) -> None:
        """Give spare memory back."""
        self._index.trim()
        known, value, block, blocks, owner = self._store
        n, m = len(self), self._n_blocks
        self._store = Store(
            known[:n].copy(), value[:n].copy(), block[:n].copy(), blocks[:m].copy(), owner[:m].copy()
        )

    @property
    def _is_solid(self) -> NDArray[np.bool_]:
        n = len(self)
        return np.asarray((self._store.known[:n] == FULL) & (self._store.block[:n] == 0))

    def _assign(self, codes: NDArray[np.int64], values: NDArray[np.float32]) -> None:
        """Make voxels known; their codes ascend."""
        rows = self._rows(codes >> BRICK_BITS)
        self._store, self._n_blocks = kernels.assign(rows, codes, values, self._store, self._n_blocks)

    def _ordered(self, keep: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return the rows to keep in the order of their codes."""
        rows = np.flatnonzero(keep)
        return rows[np.argsort(self._index.codes[rows])]

    def _rows(self, bricks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row of each brick; those not met before have no known voxels."""
        rows = self._index.add(bricks)
        known, value, block, blocks, owner = self._store
        n = len(self)
        self._store = Store(room_for(known, n), room_for(value, n), room_for(block, n), blocks, owner)
        return rows
