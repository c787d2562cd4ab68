"""Tiles: cubes of cells, the parts in which a map is stored and loaded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.accumulate import PLACE_UNIT
from semgp.blocks.arrays import F64, I64, Bool
from semgp.blocks.cells import CELL, CELL_BITS, cell_keys
from semgp.blocks.layout import around_keys
from semgp.blocks.stored import require_sites, require_times, stored_sites
from semgp.errors import InputError
from semgp.maps.blocks import ManyBlocks
from semgp.voxels import AXIS_BITS, HALF_RANGE, STEP, voxel_indices, voxel_keys

Arrays = dict[str, NDArray[Any]]

_ROWS = ("voxels", "mass", "place", "spread")
_TIMES = ("cells", "time")


@dataclass(frozen=True)
class Tiling:
    """How cells make tiles: cubes of 2^bits voxels, counted from the origin of the map's keys.

    A tile's key is that of its lowest voxel.

    Parameters
    ----------
    cells : int
        Cells along the edge of a tile: 4, 8, 16 or 32.

    Raises
    ------
    InputError
        Another number of cells.
    """

    cells: int = 4

    def __post_init__(self) -> None:
        if self.cells not in (4, 8, 16, 32):
            raise InputError(f"a tile has 4, 8, 16 or 32 cells along its edge, not {self.cells!r}.")

    @property
    def bits(self) -> int:
        """Logarithm of the voxels along the edge of a tile."""
        return CELL_BITS + self.cells.bit_length() - 1

    def keys(self, voxels: I64) -> I64:
        """Return the keys of the tiles that voxels (n,), or cells, lie in."""
        low = (1 << self.bits) - 1
        return voxels & ~np.int64(low << 2 * AXIS_BITS | low << AXIS_BITS | low)

    def of_points(self, points: F64, resolution: float, origin: I64) -> I64:
        """Return the keys of the tiles that points (n, 3) lie in, each once.

        Raises
        ------
        InputError
            Points a million voxels from the origin.
        """
        return np.unique(self.keys(voxel_keys(points, resolution, origin)))

    def round_points(self, points: F64, resolution: float, origin: I64, half: float) -> I64:
        """Return the keys of the tiles whose sites answers at points (n, 3) depend on, each once.

        Those of the cells that a box of `half` voxels to each side of a point overlaps, and of the cells round
        about them.
        """
        reach = half + CELL  # less than half a tile: a box touches two tiles at most along each axis
        voxel = points / resolution - origin
        low, high = (_clipped(v) >> self.bits for v in (voxel - reach, voxel + reach))
        code = np.unique((low @ _STEP) << 3 | (high - low) @ np.array([4, 2, 1]))
        first, wide = code >> 3, code & 7
        corners = [first[wide & way == way] + (_WAYS[way] @ _STEP) for way in range(8)]
        return np.unique(np.concatenate(corners)) << self.bits

    def overlap(self, tiles: I64, origin: I64, low: F64, high: F64, resolution: float) -> Bool:
        """Return which tiles (n,) overlap a box, corners (3,) in metres, world frame."""
        corner = voxel_indices(tiles, origin)
        first, last = np.floor(low / resolution), np.floor(high / resolution)
        return np.asarray(((corner <= last) & (corner + (1 << self.bits) > first)).all(axis=1))

    def beside(self, cells: I64, tiles: I64) -> Bool:
        """Return which cells (n,), given by their keys, lie in some of the tiles, or next to them."""
        return np.asarray(np.isin(self.keys(around_keys(cells)), tiles).any(axis=1))


_STEP = np.array(STEP, dtype=np.int64)
_WAYS = np.array([(way >> 2, way >> 1 & 1, way & 1) for way in range(8)], dtype=np.int64)


def _clipped(voxel: F64) -> I64:
    """Voxels, counted from the origin, as they are counted in keys; those out of range at the rim."""
    return np.asarray(np.clip(np.floor(voxel) + HALF_RANGE, 0, 2 * HALF_RANGE - 1).astype(np.int64))


def cut(state: ManyBlocks, tiling: Tiling, tiles: I64) -> dict[int, Arrays]:
    """Return the stored arrays of some tiles of a map, rows in the order of their voxels' keys."""
    found: dict[int, Arrays] = {int(tile): {} for tile in tiles}
    for prefix, field in state.fields.items():
        arrays = field.sites.to_arrays()
        parts = _by_tile(tiling, tiles, arrays["voxels"])
        times = _by_tile(tiling, tiles, arrays["cells"]) if "time" in arrays else {}
        for tile, mine in found.items():
            rows = parts[tile]
            mine |= {prefix + name: arrays[name][rows] for name in _ROWS if name in arrays}
            if "spread" in arrays and not arrays["spread"][rows].any():
                del mine[prefix + "spread"]  # the same bytes, whatever else was in memory
            if times:
                rows = times[tile]
                mine[prefix + "cells"] = arrays["cells"][rows]
                mine[prefix + "time"] = np.append(arrays["time"][rows], arrays["time"][-1])
    return found


def every_tile(state: ManyBlocks, tiling: Tiling) -> I64:
    """Return the keys of the tiles that have sites."""
    return np.unique(np.concatenate([tiling.keys(field.sites.voxels.keys) for field in state.fields.values()]))


def _by_tile(tiling: Tiling, tiles: I64, keys: I64) -> dict[int, I64]:
    """The rows of each tile's keys, in their order."""
    of_key = tiling.keys(keys)
    rows = np.flatnonzero(np.isin(of_key, tiles))
    rows = rows[np.lexsort((keys[rows], of_key[rows]))]
    edges = np.searchsorted(of_key[rows], np.sort(tiles)), np.searchsorted(of_key[rows], np.sort(tiles), "right")
    return {int(tile): rows[a:b] for tile, a, b in zip(np.sort(tiles), *edges)}


def take_in(state: ManyBlocks, origin: I64, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Add the arrays of a tile, from `cut` or checked by `tile_sites`, to a map that has nothing of it.

    Raises
    ------
    InputError
        Sites that the map has.
    """
    for prefix, field in state.fields.items():
        sites = {name: arrays[prefix + name] for name in (*_ROWS, *_TIMES) if prefix + name in arrays}
        field.restore(sites | {"origin": origin})


def tile_sites(
    arrays: Mapping[str, NDArray[Any]],
    prefix: str,
    tiling: Tiling,
    tile: int,
    origin: I64,
    n_classes: int,
    n_dims: int,
) -> Arrays:
    """Return the stored sites of one field of a tile, see `stored_sites`.

    Raises
    ------
    InputError
        Arrays that are damaged, or are not of this tile.
    """
    sites = stored_sites(dict(arrays) | {prefix + "origin": origin}, prefix, n_classes, n_dims)
    for name in ("voxels", "cells"):
        if (tiling.keys(sites.get(name, np.empty(0, np.int64))) != tile).any():
            raise InputError(f"the stored sites are damaged: some of the {name} lie in another tile.")
    require_sites(sites)
    if "time" in sites:
        require_times(sites["cells"], sites["time"])
    return sites


def tile_positions(arrays: Arrays, prefix: str, origin: I64, resolution: float) -> F64:
    """Return the positions (S, 3) of the sites of a tile, metres, world frame; see `Sites.positions`."""
    index = voxel_indices(arrays[prefix + "voxels"], origin)
    total = arrays[prefix + "mass"].sum(axis=1, dtype=np.int64)[:, None]
    return np.asarray((index + arrays[prefix + "place"][:, :3] / (total * float(PLACE_UNIT))) * resolution)


def drop(state: ManyBlocks, tiling: Tiling, tiles: I64) -> None:
    """Take tiles out of a map; the blocks of the others stay as they are."""
    state.keep_cells(lambda cells: ~np.isin(tiling.keys(cells), tiles))


def changed_tiles(state: ManyBlocks, tiling: Tiling) -> I64:
    """Return the keys of the tiles that have changed since this was last asked."""
    keys = [tiling.keys(cell_keys(field.take_changed())) for field in state.fields.values()]
    return np.unique(np.concatenate(keys))
