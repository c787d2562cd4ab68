"""Commits: what a writer has changed becomes the next version, merged with what others have published."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from semgp.errors import ConflictError
from semgp.maps.tiles import Arrays
from semgp.store.manifest import Manifest, Tile, voxel
from semgp.store.merge import merged
from semgp.store.store import MapStore
from semgp.store.working_set import WorkingSet

_TRIES = 20


def commit(working: WorkingSet, base: Manifest, clouds: int, note: str, merge: bool) -> Manifest:
    """Publish a working set as the version after the one it is based on, and return its manifest.

    Parameters
    ----------
    working : WorkingSet
        With changes; they are written first.
    base : Manifest
        The version on which the changes are based.
    clouds : int
        How many clouds they are from.
    note : str
        For the manifest.
    merge : bool
        Where others have published since, add both up, and try again.

    Raises
    ------
    ConflictError
        Others have published and `merge` is False, or maps forget and have changed in the same tiles, or began at
        different places. The working set keeps the changes.
    """
    working.write()
    for _ in range(_TRIES):
        origin, clock = working.state.origin, working.state.clock
        mine = replace(
            base,
            clouds=base.clouds + clouds,
            origin=voxel(origin),
            clock=clock,
            tiles=dict(working.tiles),
        )
        try:
            return working.store.publish(mine, note)
        except ConflictError:
            if not merge:
                raise
        theirs = working.store.manifest()
        tiles = _merged_tiles(working.store, base, mine, theirs)
        start = mine.origin if theirs.origin is None else theirs.origin
        clocks = [c for c in (clock, theirs.clock) if c is not None]
        working.move_to(
            tiles, None if start is None else np.array(start, dtype=np.int64), max(clocks) if clocks else None
        )
        base = theirs
    raise ConflictError(f"{working.store.location}: other writers were faster {_TRIES} times: try again later.")


def _merged_tiles(store: MapStore, base: Manifest, mine: Manifest, theirs: Manifest) -> dict[int, Tile]:
    """The files of all tiles with what both have changed."""
    if base.origin is None and theirs.origin is not None and mine.origin not in (None, theirs.origin):
        raise ConflictError(
            f"{store.location}: two writers have begun the map, at different places: open it anew, and update it "
            "again with what you have."
        )
    tiles = {}
    for key in base.tiles.keys() | mine.tiles.keys() | theirs.tiles.keys():
        a, b, c = (manifest.tiles.get(key) for manifest in (base, mine, theirs))
        chosen = c if b == a else b if c == a else _both(store, key, mine, a, b, c)
        if chosen is not None:
            tiles[key] = chosen
    return tiles


def _both(store: MapStore, key: int, mine: Manifest, a: Tile | None, b: Tile | None, c: Tile | None) -> Tile:
    if mine.settings.forgetting is not None:
        raise ConflictError(
            f"{store.location}: another writer has changed the same places, and what two have forgotten cannot be "
            "added up: open the map anew, and update it again with what you have."
        )
    before, one, other = (_arrays(store, key, mine, tile) for tile in (a, b, c))
    return store.put(key, merged(before, one, other))


def _arrays(store: MapStore, key: int, manifest: Manifest, tile: Tile | None) -> Arrays:
    return {} if tile is None else store.get(key, tile, manifest.settings)
