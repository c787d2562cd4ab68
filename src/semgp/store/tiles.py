"""The tiles of a stored map: immutable files, named by what is in them, that are written and read."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection

import numpy as np

from semgp.errors import FileFormatError, InputError
from semgp.maps.tiles import Arrays, tile_sites
from semgp.store.files import Files
from semgp.store.manifest import Tile
from semgp.store.settings import Settings
from semgp.store.tile_files import decode, encode

_NAME = re.compile(r"[0-9a-f]{16}-[0-9a-f]{32}\.npz")


class Tiles:
    """The files of the tiles of one map.

    Parameters
    ----------
    files : Files
        Where they are.
    """

    def __init__(self, files: Files) -> None:
        self.files = files

    def put(self, key: int, arrays: Arrays) -> Tile:
        """Create the file of a tile; nobody sees it before a manifest lists it."""
        data = encode(arrays)
        sites, free_sites = (len(arrays.get(name, ())) for name in ("voxels", "free.voxels"))
        tile = Tile(hashlib.sha256(data).hexdigest(), len(data), sites, free_sites)
        name = f"tiles/{tile.name(key)}"
        if not self.files.create(name, data) and self.files.read(name) != data:  # it is damaged
            self.files.remove(name)
            self.files.create(name, data)
        return tile

    def get(self, key: int, tile: Tile, settings: Settings) -> Arrays:
        """Return the arrays of a tile.

        Raises
        ------
        FileFormatError
            A file that is missing or damaged.
        """
        name = f"tiles/{tile.name(key)}"
        data = self.files.read(name, tile.n_bytes)
        try:
            if hashlib.sha256(data).hexdigest() != tile.digest:
                raise InputError("is damaged: its checksum is not the one in the manifest.")
            columns = {"": len(settings.classes) + settings.model.other}
            columns |= {} if settings.free is None else {"free.": 2}
            arrays = decode(data, columns)
            for prefix, n in columns.items():
                dims = 3 if prefix else settings.model.n_dims
                tile_sites(arrays, prefix, settings.tiling, key, np.zeros(3, np.int64), n, dims)
            counts = tuple(len(arrays.get(name, ())) for name in ("voxels", "free.voxels"))
            if counts != (tile.sites, tile.free_sites):
                raise InputError(f"is damaged: it has {counts} sites, not {(tile.sites, tile.free_sites)}.")
        except InputError as error:
            raise FileFormatError(f"{self.files.location}/{name}", str(error)) from error
        return arrays

    def orphans(self, listed: Collection[str]) -> list[str]:
        """Return the files of tiles whose names are not listed, and nothing that others have put beside them."""
        found = filter(_NAME.fullmatch, self.files.names("tiles"))
        return [f"tiles/{name}" for name in found if name not in listed]
