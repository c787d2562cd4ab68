"""Commits: what a writer has changed becomes the next version, merged with what others have published."""

from __future__ import annotations

from dataclasses import replace

from semgp.errors import ConflictError, FileFormatError
from semgp.maps.tiles import Arrays
from semgp.store.manifest import Manifest, Tile, voxel
from semgp.store.merge import merged
from semgp.store.store import MapStore
from semgp.store.versions import following_of
from semgp.store.working_set import WorkingSet

_TRIES = 20


def commit(working: WorkingSet, clouds: int, note: str, merge: bool) -> None:
    """Publish a working set as the version after the one it is based on, and go on from there.

    Parameters
    ----------
    working : WorkingSet
        With changes; they are written first.
    clouds : int
        How many clouds the changes are from.
    note : str
        For the manifest.
    merge : bool
        Where others have published since, add both up, and try again.

    Raises
    ------
    ConflictError
        Others have published and `merge` is False, or maps forget and have changed in the same tiles, or began at
        different places; or the version that mine are based on has been removed, and is needed to add them up. The
        working set keeps the changes.
    """
    working.write()
    clouds -= _came_through(working)
    if not clouds and working.tiles == working.base.tiles:
        return
    for _ in range(_TRIES):
        mine = replace(
            working.base,
            clouds=working.base.clouds + clouds,
            origin=voxel(working.state.origin),
            clock=working.state.clock,
            tiles=dict(working.tiles),
        )
        working.unanswered = following_of(mine, note)
        try:
            working.store.add(working.unanswered)
            working.base, working.unanswered = working.unanswered, None
            return
        except ConflictError:
            working.unanswered = None
            if not merge:
                raise
        theirs = working.store.manifest()
        clocks = [c for c in (mine.clock, theirs.clock) if c is not None]
        both = replace(
            theirs,
            origin=mine.origin if theirs.origin is None else theirs.origin,
            clock=max(clocks, default=None),
            tiles=_merged_tiles(working.store, working.base, mine, theirs),
        )
        working.move_to(both)
        working.base = theirs  # what is added to it is still to be published
    raise ConflictError(f"{working.store.location}: other writers were faster {_TRIES} times: try again later.")


def _came_through(working: WorkingSet) -> int:
    """Go on from what an earlier try has published without an answer; return how many clouds that has."""
    made, before = working.unanswered, working.base
    if made is None:
        return 0
    there = working.store.has(made)
    working.unanswered = None
    if not there:
        return 0
    working.base = made
    return made.clouds - before.clouds


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
    try:
        before, one, other = (_arrays(store, key, mine, tile) for tile in (a, b, c))
    except FileFormatError:
        store.require_still(mine.number)
        raise
    return store.put(key, merged(before, one, other))


def _arrays(store: MapStore, key: int, manifest: Manifest, tile: Tile | None) -> Arrays:
    return {} if tile is None else store.get(key, tile, manifest.settings)
