"""Fusing: two stored maps into a third, tile by tile."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from semgp.blocks.arrays import F64
from semgp.blocks.merging import Sums, joined, moved, stored_sums
from semgp.checks import rigid_transform
from semgp.errors import InputError
from semgp.maps.fusion import require_same, require_same_classes
from semgp.maps.tiles import Arrays, cut, every_tile
from semgp.parallel import parallel_map
from semgp.store.manifest import Manifest, Tile, voxel
from semgp.store.map import StoredMap
from semgp.store.merge import added
from semgp.store.settings import Settings
from semgp.store.store import MapStore


def fuse_stored(
    a: StoredMap, b: StoredMap, out: MapStore | str | Path, T_a_b: ArrayLike | None = None, *, note: str = ""
) -> Manifest:
    """Write the map of all that two stored maps have seen to an empty store; see `semgp.maps.fusion.fuse`.

    A few tiles at a time are in memory.

    Parameters
    ----------
    a, b : StoredMap
        With the same classes, model and free space, as committed.
    out : MapStore, str or Path
        Where to.
    T_a_b : (4, 4) array, optional
        Rigid transform from b's frame to a's, which is the fused map's.
    note : str, optional
        For the manifest.

    Raises
    ------
    InputError
        As `semgp.maps.fusion.fuse`, or a place that holds a map already.
    """
    T = np.eye(4) if T_a_b is None else rigid_transform("T_a_b", T_a_b)
    settings = _fused(a.settings, b.settings)
    store = out if isinstance(out, MapStore) else MapStore(out)
    with store.writing():
        store.require_empty()
        keep = tuple(settings.new_state().fields)
        tiles = _copied(a, store, keep)
        origin, parts = a.origin, b.parts()
        while some := [arrays for _, arrays in islice(parts, store.files.at_once)]:
            sums = [_moved(arrays, b, T, a.resolution, keep) for arrays in some]
            if origin is None:
                origin = sums[0][""].origin
            state = settings.new_state()
            for prefix, field in state.fields.items():
                field.restore(joined([part[prefix] for part in sums], origin))
            _add(store, settings, tiles, cut(state, settings.tiling, every_tile(state, settings.tiling)))
        clouds = a.clouds + b.clouds
        fused = store.publish(Manifest(0, settings, "", origin=voxel(origin), tiles=tiles, clouds=clouds), note)
    store.tidy()  # what tiles were before all of b had been added
    return fused


def _moved(arrays: Arrays, b: StoredMap, T: F64, resolution: float, prefixes: tuple[str, ...]) -> dict[str, Sums]:
    """The sums of a tile of b in the fused map's frame and voxels."""
    assert b.origin is not None
    known = arrays | {prefix + "origin": b.origin for prefix in prefixes}
    return {prefix: moved(stored_sums(known, prefix), T, b.resolution, resolution) for prefix in prefixes}


def _add(store: MapStore, settings: Settings, tiles: dict[int, Tile], parts: dict[int, Arrays]) -> None:
    """Add what some tiles are to have to their files."""

    def add(key: int) -> Tile:
        old = [store.get(key, tiles[key], settings)] if key in tiles else []
        return store.put(key, added([*old, parts[key]]))

    tiles |= dict(zip(parts, parallel_map(add, parts, store.files.at_once)))


def _copied(a: StoredMap, store: MapStore, keep: tuple[str, ...]) -> dict[int, Tile]:
    """Write the tiles of a map to another store, a few at a time."""
    tiles: dict[int, Tile] = {}
    parts, at_once = a.parts(), store.files.at_once
    while some := dict(islice(parts, at_once)):
        tiles |= dict(zip(some, parallel_map(lambda key: store.put(key, _only(some[key], keep)), some, at_once)))
    return tiles


def _only(arrays: Arrays, prefixes: tuple[str, ...]) -> Arrays:
    """Return the arrays of some of the fields."""
    return {name: a for name, a in arrays.items() if name[: name.rfind(".") + 1] in prefixes}


def _fused(a: Settings, b: Settings) -> Settings:
    """Return the fused map's settings."""
    require_same_classes(a.classes, b.classes)
    require_same("models", a.model, b.model, "the same model for both builds")
    if a.forgetting is not None or b.forgetting is not None:
        raise InputError(
            "a map forgets, and what two maps forgot at different times cannot be added up: fuse maps without "
            "forgetting."
        )
    if a.free is None or b.free is None:
        return replace(a, free=None)
    require_same("settings of free space", a.free, b.free, "the same settings for both builds")
    return a
