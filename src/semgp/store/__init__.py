"""Stored maps: tiles on disk or in a bucket, in numbered versions that are never overwritten."""

from semgp.store.manifest import Manifest, Settings, Tile
from semgp.store.map import MOST_SITES, StoredMap
from semgp.store.store import MapStore

__all__ = ["MOST_SITES", "Manifest", "MapStore", "Settings", "StoredMap", "Tile"]
