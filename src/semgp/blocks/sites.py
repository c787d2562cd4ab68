"""Sites: what the map keeps of all labels, the class mass and mean position of each voxel that has some.

All sums are integers. A sum of integers does not depend on its order, so neither does the map: scans in any order
and any number of threads give the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.accumulate import (
    PLACE_UNIT,
    add_hard,
    add_soft,
    add_spread,
    chain,
    fade_cells,
    fade_rows,
)
from semgp.blocks.arrays import F64, I32, I64, U32, Bool
from semgp.blocks.cells import cell_keys, cell_origin
from semgp.blocks.observations import Observations, counted
from semgp.blocks.stored import require_sites, require_times
from semgp.errors import InputError
from semgp.voxels import VoxelTable, voxel_indices, voxel_keys

LEAST_FADED = 0.98
"""The factor from which on a cell fades."""


class Sites:
    """Class mass, position and features of each voxel with labels, and the cells that the voxels lie in.

    A site is the mean of its voxel's labelled points. Cells are cubes of `CELL` voxels, aligned to the world's
    origin: the unit that is solved again when its data change.

    Parameters
    ----------
    n_classes : int
        C.
    n_features : int
        Inputs beyond the three coordinates.
    resolution : float
        Edge of a voxel in metres.

    Attributes
    ----------
    drift : (cells,) array
        How much each cell's sites have changed since someone set this to 0, summed over them: 1 for a new site;
        for a label added to n, (1 - its class's share + 1/2) / (n + 1), half the L1 change of the shares and half
        the growth of the mass.
    clock : float or None
        The time, for whom it matters, see `fade`; None as long as nobody has set it.
    time : (cells,) array
        When each cell was last faded, or was new.
    """

    def __init__(self, n_classes: int, n_features: int, resolution: float) -> None:
        self.resolution = resolution
        self.origin: I64 | None = None
        self.voxels, self.cells = VoxelTable(), VoxelTable()
        self._mass = np.zeros((0, n_classes), dtype=np.uint32)
        self._place = np.zeros((0, 3 + n_features), dtype=np.int64)
        self._spread = np.zeros((0, 4), dtype=np.int64)
        self._next = np.empty(0, dtype=np.int32)
        self._cell = np.empty(0, dtype=np.int32)
        self._head = np.empty(0, dtype=np.int32)
        self._size = np.empty(0, dtype=np.int32)
        self.drift, self.time = np.empty(0, dtype=np.float64), np.empty(0, dtype=np.float64)
        self.clock: float | None = None

    def __len__(self) -> int:
        return len(self.voxels)

    @property
    def mass(self) -> U32:
        """Class mass (S, C) in steps of 1 / `MASS_UNIT`."""
        return self._mass[: len(self)]

    @property
    def place(self) -> I64:
        """Mass times position within the voxel and features, summed (S, 3 + F)."""
        return self._place[: len(self)]

    @property
    def spread(self) -> I64:
        """Mass times variance of position, summed along three axes, and the set of draws (S, 4).

        Points that are displaced together, those of one scan, are one draw. A set has 48 bits; two draws of many
        may share one. (0, 4) as long as all positions are certain.
        """
        return self._spread[: len(self)]

    @property
    def head(self) -> I32:
        """First site of each cell, -1 for none."""
        return self._head[: len(self.cells)]

    @property
    def size(self) -> I32:
        """Number of sites of each cell."""
        return self._size[: len(self.cells)]

    @property
    def next(self) -> I32:
        """The site that follows each site in its cell, -1 for none."""
        return self._next[: len(self)]

    @property
    def positions(self) -> F64:
        """Positions (S, 3) in metres, world frame."""
        if self.origin is None:
            return np.empty((0, 3))
        index = voxel_indices(self.voxels.keys, self.origin)
        total = self.mass.sum(axis=1, dtype=np.int64)[:, None]
        return np.asarray((index + self.place[:, :3] / (total * float(PLACE_UNIT))) * self.resolution)

    @property
    def n_bytes(self) -> int:
        """Bytes of all arrays."""
        owned = (self._mass, self._place, self._spread, self._next, self._cell, self._head, self._size)
        return sum(a.nbytes for a in owned) + self.voxels.n_bytes + self.cells.n_bytes

    def add(self, given: Observations) -> I32:
        """Add labelled points and return the cells that they lie in.

        Raises
        ------
        InputError
            Points a million voxels from the first, or weights, features or variances beyond what a sum can hold.
        """
        (points, labels, weights, features, _, variances, draws), amounts = counted(given)
        if not len(points):
            return np.empty(0, dtype=np.int32)
        origin = self.origin
        if origin is None:
            origin = cell_origin(points, self.resolution)
        keys = voxel_keys(points, self.resolution, origin)
        self.origin, known = origin, len(self)
        rows = self.voxels.insert(keys)
        self._grow()
        self._link(known)
        where = (amounts, points, self.resolution, features, self._cell, self._mass, self._place, self.drift)
        if labels is not None:
            add_hard(rows, labels, *where)
        elif weights is not None:
            add_soft(rows, weights, *where)
        if variances is not None and draws is not None:
            self._spread = _extended(self._spread, len(self), 0)
            add_spread(rows, amounts, variances, draws, self._spread)
        touched = np.zeros(len(self.cells), dtype=bool)
        touched[self._cell[rows]] = True
        return np.flatnonzero(touched).astype(np.int32)

    def fade(self, cells: I64, half_life: float) -> None:
        """Let the sites of some cells lose half their mass for each half-life since the cells were last faded.

        Less than `LEAST_FADED` waits for the next time: in many small steps rounding would stop what is light.
        """
        assert self.clock is not None
        factors = 0.5 ** ((self.clock - self.time[cells]) / half_life)
        cells, factors = cells[factors <= LEAST_FADED], factors[factors <= LEAST_FADED]
        fade_cells(cells, factors, self._head, self._next, self._mass, self._place, self._spread)
        self.time[cells] = self.clock

    def fade_sites(self, rows: I64, factor: float) -> I32:
        """Multiply the mass of some sites by a factor below 1, and return their cells."""
        fade_rows(rows, factor, self._cell, self._mass, self._place, self._spread, self.drift)
        return np.unique(self._cell[rows])

    def cell_ids(self, keys: I64) -> I32:
        """Return the cells of cell keys; those not met before are new, and empty."""
        known, ids = len(self.cells), self.cells.insert(keys).astype(np.int32)
        self._head = _extended(self._head, len(self.cells), -1)
        self._size = _extended(self._size, len(self.cells), 0)
        self.drift = _extended(self.drift, len(self.cells), 0)
        self.time = _extended(self.time, len(self.cells), 0)
        self.time[known : len(self.cells)] = self.clock or 0.0
        return ids

    def _grow(self) -> None:
        n = len(self.voxels)
        self._mass, self._place = _extended(self._mass, n, 0), _extended(self._place, n, 0)
        if len(self._spread):
            self._spread = _extended(self._spread, n, 0)
        self._next, self._cell = _extended(self._next, n, -1), _extended(self._cell, n, -1)

    def _link(self, known: int) -> None:
        """Append the sites from `known` on to the chains of their cells."""
        new = self.voxels.keys[known:]
        cells = self.cell_ids(cell_keys(new))
        self._cell[known : known + len(new)] = cells
        chain(cells, known, self._head, self._size, self._next)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays from which `restore` makes the same sites."""
        origin = np.zeros(3, dtype=np.int64) if self.origin is None else self.origin
        arrays: dict[str, NDArray[Any]]
        arrays = {"voxels": self.voxels.keys, "mass": self.mass, "place": self.place, "origin": origin}
        if len(self._spread):
            arrays["spread"] = self.spread
        if self.clock is not None:
            arrays |= {"cells": self.cells.keys, "time": np.append(self.time[: len(self.cells)], self.clock)}
        return arrays

    def only(self, keep: Bool) -> dict[str, NDArray[Any]]:
        """Return the arrays of some of the sites."""
        rows = ("voxels", "mass", "place", "spread")
        return {name: a[keep] if name in rows else a for name, a in self.to_arrays().items()}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> I32:
        """Take in what `to_arrays` gave, of voxels and times of cells not met before, and return the new cells.

        Raises
        ------
        InputError
            Keys out of range or twice, sites without mass or beyond their voxel, an origin within a cell or
            elsewhere than that of the sites so far. The sites are then as before.
        """
        keys, known, cells = arrays["voxels"], len(self), len(self.cells)
        require_sites(arrays)
        begun = len(keys) > 0 or len(arrays.get("cells", ())) > 0
        if begun and self.origin is not None and (arrays["origin"] != self.origin).any():
            raise InputError("the stored sites are damaged: they do not begin where the others do.")
        if (self.voxels.find(keys) >= 0).any():
            raise InputError("the stored sites are damaged: a voxel occurs twice.")
        if begun:
            self.origin = arrays["origin"]
        if "time" in arrays:
            self._restore_times(arrays["cells"], arrays["time"])
        if len(keys):
            self.voxels.insert(keys)
            self._grow()
            self._mass[known : len(self)], self._place[known : len(self)] = arrays["mass"], arrays["place"]
            if "spread" in arrays:
                self._spread = _extended(self._spread, len(self), 0)
                self._spread[known : len(self)] = arrays["spread"]
            self._link(known)
        return np.arange(cells, len(self.cells), dtype=np.int32)

    def _restore_times(self, cells: I64, times: F64) -> None:
        """Take in when cells were last faded, the clock last."""
        require_times(cells, times)
        ids = self.cell_ids(cells)
        self.time[ids] = times[:-1]
        self.clock = float(times[-1]) if self.clock is None else max(self.clock, float(times[-1]))


def _extended(a: NDArray[Any], n: int, fill: int) -> NDArray[Any]:
    """The array with room for n rows at least, doubled where it was too short."""
    if n <= len(a):
        return a
    longer = np.empty((max(n, 2 * len(a)), *a.shape[1:]), dtype=a.dtype)
    longer[: len(a)] = a
    longer[len(a) :] = fill
    return longer
