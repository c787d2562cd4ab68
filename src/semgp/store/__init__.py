"""Stored maps: tiles on disk or in a bucket, in numbered versions that are never overwritten."""

from semgp.store.building import BATCH, build
from semgp.store.fusing import fuse_stored
from semgp.store.manifest import Manifest, Tile
from semgp.store.map import MOST_SITES, StoredMap
from semgp.store.saving import save
from semgp.store.settings import Settings
from semgp.store.store import MapStore

__all__ = [
    "BATCH",
    "MOST_SITES",
    "Manifest",
    "MapStore",
    "Settings",
    "StoredMap",
    "Tile",
    "build",
    "fuse_stored",
    "save",
]
