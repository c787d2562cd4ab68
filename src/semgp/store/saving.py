"""Saving: a map in memory into a store."""

from __future__ import annotations

from pathlib import Path

from semgp.errors import InputError
from semgp.maps.gp import GPSemanticMap
from semgp.maps.tiles import Tiling, cut, every_tile
from semgp.parallel import parallel_map
from semgp.store.manifest import Manifest, voxel
from semgp.store.settings import Settings
from semgp.store.store import MapStore


def save(semantic_map: GPSemanticMap, store: MapStore | str | Path, *, cells: int = 4, note: str = "") -> Manifest:
    """Write a map in memory to an empty store, and return the manifest.

    Parameters
    ----------
    semantic_map : GPSemanticMap
        Of many blocks.
    store : MapStore, str or Path
        Where to.
    cells : int, optional
        Cells along the edge of a tile.
    note : str, optional
        For the manifest.

    Raises
    ------
    InputError
        The paper's map, which has no blocks, or a place that holds a map already.
    """
    state = semantic_map.many_blocks
    if state is None:
        raise InputError("the paper's map of one training set has no tiles: save it to a .semgp file.")
    store = store if isinstance(store, MapStore) else MapStore(store)
    tiling, up = Tiling(cells), semantic_map.up
    settings = Settings(semantic_map.classes, state.model, state.free, state.forgetting, tiling, up)
    with store.writing():
        store.require_empty()
        keys = every_tile(state, settings.tiling)
        parts = cut(state, settings.tiling, keys)
        put = parallel_map(lambda tile: store.put(tile, parts[tile]), parts, store.files.at_once)
        tiles = dict(zip(parts, put))
        return store.publish(
            Manifest(0, settings, "", origin=voxel(state.origin), clock=state.clock, tiles=tiles), note
        )
