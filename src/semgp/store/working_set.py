"""The working set: those tiles of a stored map that are in memory, as one map."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

import numpy as np

from semgp.blocks.arrays import F64, I64
from semgp.errors import FileFormatError, InputError
from semgp.maps.tiles import Arrays, changed_tiles, cut, drop, take_in
from semgp.parallel import parallel_map, slices
from semgp.store.manifest import Manifest, Tile
from semgp.store.store import MapStore


class WorkingSet:
    """Tiles in memory, loaded when needed, the ones not used for longest dropped when there are too many.

    Parameters
    ----------
    store : MapStore
        Where the tiles come from, and where changed ones go.
    manifest : Manifest
        The version to begin with.
    most_sites : int
        So many sites may be in memory, more only where one call needs them.

    Attributes
    ----------
    state : ManyBlocks
        The map of the tiles in memory.
    base : Manifest
        The version that the map has gone on from.
    unanswered : Manifest or None
        The next version, where the store failed before it told whether that is there.
    tiles : dict of int to Tile
        The files of all tiles of the map, those that no manifest lists yet included.
    sizes : dict of int to int
        The sites in each of these files.
    """

    def __init__(self, store: MapStore, manifest: Manifest, most_sites: int) -> None:
        self.store, self.settings, self.base = store, manifest.settings, manifest
        self.state = manifest.settings.new_state()
        self.tiles, self.sizes = dict(manifest.tiles), _sizes(manifest.tiles)
        self.most_sites = most_sites
        self.unanswered: Manifest | None = None
        self._held: dict[int, None] = {}  # the one used last comes last
        self._changed: set[int] = set()
        if manifest.origin is not None:
            self.state.begin(np.array(manifest.origin, dtype=np.int64), manifest.clock)

    def hold(self, wanted: I64) -> None:
        """Have those of the wanted tiles that there are in memory.

        Raises
        ------
        FileFormatError
            A tile whose file is damaged or missing; none of those that were not in memory are then.
            ConflictError where it is missing because its version has been removed.
        """
        needed = [tile for tile in wanted.tolist() if tile in self.tiles or tile in self._held]
        missing = [tile for tile in needed if tile not in self._held]
        loaded = self.read(missing)
        self.make_room(sum(self.sizes[tile] for tile in missing), set(needed))
        for tile, arrays in loaded.items():
            self._take_in(tile, arrays)
        for tile in needed:
            self._held.pop(tile, None)
            self._held[tile] = None

    def _take_in(self, tile: int, arrays: Arrays) -> None:
        assert self.state.origin is not None
        try:
            take_in(self.state, self.state.origin, arrays)
        except InputError as error:
            self._drop([tile])
            raise FileFormatError(
                f"{self.store.location}/tiles/{self.tiles[tile].name(tile)}", str(error)
            ) from error
        self._held[tile] = None

    def read(self, tiles: Iterable[int]) -> dict[int, Arrays]:
        """Return the arrays in tiles' files."""
        tiles = list(tiles)
        try:
            at_once = self.store.files.at_once
            read = parallel_map(lambda t: self.store.get(t, self.tiles[t], self.settings), tiles, at_once)
        except FileFormatError:
            self.store.require_still(self.base.number)
            raise
        return dict(zip(tiles, read))

    def make_room(self, coming: int = 0, needed: Collection[int] = ()) -> None:
        """Drop tiles that are not needed, those not used for longest first, until so many more sites fit."""
        if self.state.n_known + coming <= self.most_sites:
            return
        left, dropped = self.state.n_known + coming, []
        for tile in self._held:
            if left <= self.most_sites * 3 // 4:  # some room for the next ones, too
                break
            if tile not in needed:
                dropped.append(tile)
                left -= self.sizes.get(tile, 0)
        if dropped:
            self.write(self._changed.intersection(dropped))
            self._drop(dropped)

    def _drop(self, tiles: list[int]) -> None:
        drop(self.state, self.settings.tiling, np.array(tiles, dtype=np.int64))
        for tile in tiles:
            self._held.pop(tile, None)

    def mark(self) -> None:
        """Take notice of what has changed in the map."""
        for tile in changed_tiles(self.state, self.settings.tiling).tolist():
            self._held.setdefault(tile)
            self._changed.add(tile)

    @property
    def is_changed(self) -> bool:
        """Whether tiles in memory differ from their files."""
        return bool(self._changed)

    def write(self, tiles: Iterable[int] | None = None) -> None:
        """Write changed tiles, all of them by default, to files that no manifest lists yet."""
        chosen = sorted(self._changed if tiles is None else tiles)
        arrays = cut(self.state, self.settings.tiling, np.array(chosen, dtype=np.int64))
        written = parallel_map(lambda t: self.store.put(t, arrays[t]), chosen, self.store.files.at_once)
        for tile, file in zip(chosen, written):
            self.tiles[tile], self.sizes[tile] = file, file.all_sites
        self._changed.difference_update(chosen)

    def parts(self, low: F64 | None = None, high: F64 | None = None) -> Iterator[tuple[int, Arrays]]:
        """Yield keys and arrays of all tiles, in memory or not, or of those that overlap a box."""
        tiles = np.array(sorted(self.tiles.keys() | self._changed), dtype=np.int64)
        if low is not None and high is not None and self.state.origin is not None:
            settings = self.settings
            tiles = tiles[settings.tiling.overlap(tiles, self.state.origin, low, high, settings.resolution)]
        for some in slices(len(tiles), self.store.files.at_once):
            ahead = self.read(tile for tile in tiles[some].tolist() if tile not in self._held)
            for tile in tiles[some].tolist():
                if tile in self._held:
                    yield tile, cut(self.state, self.settings.tiling, np.array([tile]))[tile]
                else:
                    yield tile, ahead.pop(tile) if tile in ahead else self.read([tile])[tile]

    @property
    def n_sites(self) -> int:
        """Sites of the map, in files or in memory: 0 for none at all."""
        return sum(self.sizes.values()) or self.state.n_known

    def info(self) -> dict[str, int]:
        """Return how much of the map is in memory."""
        return {
            "tiles_in_memory": len(self._held),
            "sites_in_memory": self.state.n_known,
            "bytes_in_memory": sum(f.sites.n_bytes + f.store.n_bytes for f in self.state.fields.values()),
        }

    def move_to(self, manifest: Manifest) -> None:
        """Go on from another version: tiles that differ leave memory, and blocks beside them are solved anew.

        Changes that were not written are lost.
        """
        tiles, clock = manifest.tiles, manifest.clock
        differ = [t for t in tiles.keys() | self.tiles.keys() if tiles.get(t) != self.tiles.get(t)]
        differ += self._changed.difference(differ)
        gone = np.array(differ, dtype=np.int64)
        for field in self.state.fields.values():
            beside = self.settings.tiling.beside(field.sites.cells.keys, gone)
            field.store.grow(len(beside), stale=False)
            field.store.stale[beside] = True
        self._drop(differ)
        self._changed.clear()
        self.base, self.tiles, self.sizes = manifest, dict(tiles), _sizes(tiles)
        self.unanswered = None
        before = self.state.clock
        if manifest.origin is None or (before is not None and (clock is None or clock < before)):  # back in time
            self.state = self.settings.new_state()
            self._held.clear()
        if manifest.origin is not None:
            self.state.begin(np.array(manifest.origin, dtype=np.int64), clock)


def _sizes(tiles: Mapping[int, Tile]) -> dict[int, int]:
    return {key: tile.all_sites for key, tile in tiles.items()}
