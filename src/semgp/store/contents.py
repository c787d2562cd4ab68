"""All that a stored map holds, tile by tile, and parts of it as maps in memory."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from semgp.blocks.accumulate import MASS_UNIT
from semgp.blocks.arrays import F64, I64
from semgp.blocks.cells import CELL
from semgp.maps.forgetting import FAINT
from semgp.maps.gp import GPSemanticMap
from semgp.maps.occupancy import FREE, OCCUPIED
from semgp.maps.tiles import Arrays, take_in, tile_positions
from semgp.store.manifest import Manifest
from semgp.store.settings import Settings
from semgp.store.store import MapStore


def in_memory(
    settings: Settings, parts: Iterable[tuple[int, Arrays]], origin: I64 | None, clock: float | None
) -> GPSemanticMap:
    """Return a map in memory of tiles, given by keys and arrays."""
    state = settings.new_state()
    if origin is not None:
        state.begin(origin, clock)
        for _, arrays in parts:
            take_in(state, origin, arrays)
    made = GPSemanticMap.of_state(state)
    made.up = settings.up
    return made


def labelled_positions(settings: Settings, arrays: Arrays, origin: I64) -> F64:
    """Return where a tile has labels, (n, 3), metres, but for sites that are forgotten."""
    X = tile_positions(arrays, "", origin, settings.resolution)
    if settings.forgetting is None:
        return X
    return np.asarray(X[arrays["mass"].sum(axis=1, dtype=np.int64) >= FAINT * MASS_UNIT])


def space_positions(settings: Settings, arrays: Arrays, origin: I64, label: int) -> F64:
    """Return where most sightings in a tile say `FREE` or `OCCUPIED`, (n, 3), metres."""
    mass = arrays["free.mass"]
    X = tile_positions(arrays, "free.", origin, settings.resolution)
    return np.asarray(X[mass[:, label] > mass[:, OCCUPIED + FREE - label]])


def describe(store: MapStore, manifest: Manifest) -> dict[str, Any]:
    """Return what a version's manifest says, ready for JSON."""
    settings = manifest.settings
    described = {
        "kind": "gp",
        "classes": list(settings.classes.names),
        "model": settings.model.to_json(),
        "store": store.location,
        "version": manifest.number,
        "versions": len(store.numbers()),
        "time": manifest.time,
        "note": manifest.note,
        "clouds": manifest.clouds,
        "sites": manifest.sites,
        "tiles": len(manifest.tiles),
        "tile_metres": CELL * settings.tiling.cells * settings.resolution,
        "bytes_on_disk": manifest.n_bytes,
    }
    return described if settings.free is None else described | {"free_sites": manifest.free_sites}
