"""What tests of stored maps share: clouds along a street whose tiles are five metres wide, and comparisons."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from semgp.blocks.arrays import F64
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.prediction import Prediction
from semgp.store import Manifest, MapStore, Settings, StoredMap

CLASSES = Classes(("floor", "wall", "table"))
MODEL = replace(GENERAL, resolution=0.02)
PLAIN = Settings(CLASSES, MODEL)
FREE = Settings(CLASSES, MODEL, FreeSpace(rays=300))
FORGETTING = Settings(CLASSES, MODEL, FreeSpace(rays=300), Forgetting(2.0))


def cloud(seed: int, x: float = 0.0, n: int = 300, **more: Any) -> LabelledCloud:
    """Four metres of street that begin at x, seen from above; a label in ten is missing."""
    rng = np.random.default_rng(seed)
    X = np.column_stack([rng.uniform(x, x + 4, n), rng.uniform(0, 3, n), rng.normal(scale=0.03, size=n)])
    labels = (np.floor(X[:, 0]) % 3).astype(np.int32)
    labels[rng.random(n) < 0.1] = -1
    T = np.eye(4)
    T[:3, 3] = (x + 2, 1.5, 1)
    given: dict[str, Any] = {"labels": labels} if "weights" not in more else {}
    return LabelledCloud(X, CLASSES, **given, T_world_sensor=T, **more)


STREET = [cloud(i, 3.0 * i) for i in range(5)]
"""Five clouds, each three metres further along."""


def uncertain(seed: int, x: float = 0.0) -> LabelledCloud:
    """A cloud whose positions are known to one or two centimetres."""
    rng = np.random.default_rng(seed)
    return cloud(seed, x, covariances=np.eye(3) * rng.uniform(1e-4, 4e-4, (300, 1, 1)))


def places(seed: int, n: int = 400, length: float = 16.0) -> F64:
    """Query points along the street, some of them off it."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-1, length, n), rng.uniform(-0.5, 3.5, n), rng.normal(scale=0.1, size=n)])


def in_memory(settings: Settings, *clouds: LabelledCloud) -> GPSemanticMap:
    """The map that a stored one is compared with."""
    made = GPSemanticMap(settings.classes, settings.model, free=settings.free, forgetting=settings.forgetting)
    for one in clouds:
        made.update(one)
    return made


def crowd(*seeds: int) -> Prediction:
    """Return what a map of clouds at one place, as the fixture `crowded` has them, says of some points."""
    return in_memory(PLAIN, *(cloud(seed, 1.0) for seed in seeds)).query(places(1))


def stored(place: Path, *clouds: LabelledCloud, settings: Settings = PLAIN, most_sites: int = 10**6) -> StoredMap:
    """A committed map of some clouds, opened anew."""
    with StoredMap.create(place, settings) as made:
        for one in clouds:
            made.update(one)
    return StoredMap(place, most_sites=most_sites)


def assert_same(a: Prediction, b: Prediction, tolerance: float = 0.0) -> None:
    """Check that two answers are the same, to the last bit by default."""
    assert a.variance is not None
    assert b.variance is not None
    if tolerance == 0:
        np.testing.assert_array_equal(a.observed, b.observed)
    pairs = [(a.probability, b.probability), (a.variance, b.variance)]
    assert (a.occupancy is None) == (b.occupancy is None)
    if a.occupancy is not None and b.occupancy is not None:
        np.testing.assert_array_equal(a.occupancy.known, b.occupancy.known)
        pairs.append((a.occupancy.probability, b.occupancy.probability))
    for x, y in pairs:
        np.testing.assert_allclose(x, y, rtol=0, atol=tolerance)


def signed(plain: dict[str, Any] | str) -> bytes:
    """A manifest's file with a checksum that fits."""
    line = (plain if isinstance(plain, str) else json.dumps(plain)).encode()
    return hashlib.sha256(line).hexdigest().encode() + b"\n" + line + b"\n"


def manifest_path(store: MapStore, number: int | None = None) -> Path:
    """The file of a version's manifest."""
    return Path(store.location) / "manifests" / f"{number or store.numbers()[-1]:08d}.json"


def rewrite(store: MapStore, change: Callable[[dict[str, Any]], Any]) -> Path:
    """Change the JSON of the newest manifest in place, and sign it again."""
    path = manifest_path(store)
    plain = json.loads(path.read_bytes().split(b"\n")[1])
    change(plain)
    path.write_bytes(signed(plain))
    return path


def replace_tile(store: MapStore, key: int, data: bytes) -> Path:
    """Put other bytes in the place of a tile, with a manifest to which they belong; return the tile's path."""
    manifest = store.manifest()
    tile = manifest.tiles[key]._replace(digest=hashlib.sha256(data).hexdigest(), n_bytes=len(data))
    path = Path(store.location) / "tiles" / tile.name(key)
    path.write_bytes(data)
    publish(store, replace(manifest, tiles={**manifest.tiles, key: tile}))
    return path


def publish(store: MapStore, manifest: Manifest) -> Manifest:
    """Publish a manifest as the newest version."""
    return store.publish(replace(manifest, number=store.numbers()[-1]))
