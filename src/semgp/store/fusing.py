"""Fusing: two stored maps into a third, tile by tile."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from semgp.blocks.merging import joined, moved, stored_sums
from semgp.checks import rigid_transform
from semgp.errors import InputError
from semgp.maps.fusion import require_same, require_same_classes
from semgp.maps.tiles import Arrays, cut, every_tile
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
        tiles = {key: store.put(key, _only(arrays, keep)) for key, arrays in a.parts()}
        origin = a.origin
        for _, arrays in b.parts():
            assert b.origin is not None
            known = arrays | {prefix + "origin": b.origin for prefix in keep}
            sums = {p: moved(stored_sums(known, p), T, b.resolution, a.resolution) for p in keep}
            if origin is None:
                origin = sums[""].origin
            state = settings.new_state()
            for prefix, field in state.fields.items():
                field.restore(joined([sums[prefix]], origin))
            _add(store, settings, tiles, cut(state, settings.tiling, every_tile(state, settings.tiling)))
        clouds = a.clouds + b.clouds
        fused = store.publish(Manifest(0, settings, "", origin=voxel(origin), tiles=tiles, clouds=clouds), note)
    store.tidy()  # what tiles were before all of b had been added
    return fused


def _add(store: MapStore, settings: Settings, tiles: dict[int, Tile], parts: dict[int, Arrays]) -> None:
    """Add what some tiles are to have to their files."""
    for key, arrays in parts.items():
        old = [store.get(key, tiles[key], settings)] if key in tiles else []
        tiles[key] = store.put(key, added([*old, arrays]))


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
