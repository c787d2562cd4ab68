"""Writers of stored maps, and the clouds that they write: `benchmarks/store_crashes.py` kills them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.executors import Threads
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.readers import open_scans
from semgp.store import MapStore, Settings, StoredMap, Tile, build

SECTORS = 6  # pieces of a scan, each a cloud of its own
REACH, POINTS = 25.0, 3000  # metres, and points of each piece
MODEL = replace(OUTDOOR_LIDAR, resolution=0.05)  # tiles of 12.8 m
MOST_SITES = 10_000
KEPT = 2  # versions, by the writer that drops older ones

Tiles = dict[int, Tile]
Tell = Callable[[int], Any]


def pieces(folder: Path) -> list[LabelledCloud]:
    """Parts of the scans of a SemanticKITTI sequence, a few thousand points each."""
    rng, parts = np.random.default_rng(0), []
    for scan in open_scans(folder):
        assert scan.origin is not None
        x, y, _ = (scan.points - scan.origin).T
        sector = ((np.arctan2(y, x) + np.pi) / (2 * np.pi) * SECTORS).astype(int) % SECTORS
        near = (np.hypot(x, y) < REACH) & scan.labelled
        for s in range(SECTORS):
            rows = np.flatnonzero(near & (sector == s))
            parts.append(scan[rng.permutation(rows)[:POINTS]])
    return parts


def street(n: int) -> list[LabelledCloud]:
    """Clouds along a street that was made up."""
    rng, classes = np.random.default_rng(0), Classes(("road", "kerb", "wall"))
    clouds = []
    for i in range(n):
        X = rng.uniform((2.0 * i, -8, 0), (2.0 * i + 15, 8, 0.1), (1500, 3))
        clouds.append(LabelledCloud(X, classes, np.minimum(np.abs(X[:, 1]) // 3, 2).astype(np.int32)))
    return clouds


def by_updates(place: Path, clouds: Sequence[LabelledCloud], tell: Tell, keep: int | None = None) -> None:
    """Write a map cloud by cloud, from where it is."""
    store = MapStore(place)
    if not store.numbers():
        store.create(Settings(clouds[0].classes, MODEL))
    with StoredMap(store, most_sites=MOST_SITES) as stored:
        for i in range(stored.clouds, len(clouds)):
            stored.update(clouds[i])
            if i % 3 == 2:
                stored.commit()
                tell(stored.clouds)
                if keep is not None:
                    store.drop(store.numbers()[:-keep])


def by_updates_that_drop(place: Path, clouds: Sequence[LabelledCloud], tell: Tell) -> None:
    """Write a map cloud by cloud, and let go of old versions between."""
    by_updates(place, clouds, tell, KEPT)


def by_build(place: Path, clouds: Sequence[LabelledCloud], tell: Tell) -> None:
    """Write a map by two threads, from where it is."""
    store = MapStore(place)
    if not store.numbers():
        store.create(Settings(clouds[0].classes, MODEL))
    start = store.manifest().clouds
    for i in range(start, len(clouds), 4):
        tell(build(store, clouds[i : i + 4], Threads(2), batch=2).clouds)


def undisturbed(place: Path, clouds: Sequence[LabelledCloud]) -> dict[int, Tiles]:
    """The tiles of a map after each number of clouds."""
    found: dict[int, Tiles] = {0: {}}
    with StoredMap.create(place, Settings(clouds[0].classes, MODEL)) as stored:
        for i, cloud in enumerate(clouds, 1):
            stored.update(cloud)
            stored.commit()
            found[i] = dict(MapStore(place).manifest().tiles)
    return found
