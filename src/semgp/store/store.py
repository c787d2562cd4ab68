"""The store: a map's versions on disk or in a bucket, as tile files and the manifests that list them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from semgp.errors import ConflictError, FileFormatError, InputError
from semgp.maps.tiles import Arrays, tile_sites
from semgp.parallel import parallel_map
from semgp.store.bucket import open_files
from semgp.store.files import Files
from semgp.store.manifest import Manifest, Tile
from semgp.store.settings import Settings
from semgp.store.tile_files import decode, encode

_MANIFEST = re.compile(r"([0-9]{8,18})\.json")
_TILE = re.compile(r"[0-9a-f]{16}-[0-9a-f]{32}\.npz")


class MapStore:
    """A folder or bucket with the versions of one map.

    `tiles/` holds immutable files of sites, `manifests/` one file a version, numbered from 1. Both are created
    whole or not at all, and never overwritten; a version is there when its manifest is. Whoever creates the next
    number first has won.

    Parameters
    ----------
    location : str or Path
        A folder, or a URL such as s3://bucket/drive, gs://... or az://... (extra `cloud`).
    files : Files, optional
        Instead of the files at the location.

    Raises
    ------
    InputError
        A location that cannot be; MissingExtraError where an extra is missing.
    """

    def __init__(self, location: str | Path, files: Files | None = None) -> None:
        self.files = open_files(location) if files is None else files

    @property
    def location(self) -> str:
        """The folder's path or the bucket's URL."""
        return self.files.location

    def create(self, settings: Settings, note: str = "") -> Manifest:
        """Begin a map: publish version 1, without tiles.

        Raises
        ------
        InputError
            There is a map already.
        """
        self.require_empty()
        return self.publish(Manifest(0, settings, ""), note)

    def require_empty(self) -> None:
        """Raise InputError where there is a map already."""
        if self.numbers():
            raise InputError(f"{self.location} holds a map already: update it, or choose another place.")

    def numbers(self) -> list[int]:
        """Return the numbers of the versions, ascending."""
        found = (_MANIFEST.fullmatch(name) for name in self.files.names("manifests"))
        return sorted(int(match[1]) for match in found if match)

    def manifest(self, number: int | None = None) -> Manifest:
        """Return a version's manifest, the newest by default.

        Raises
        ------
        InputError
            No map at the location, or no such version; FileFormatError for a damaged manifest.
        """
        numbers = self.numbers()
        if not numbers:
            raise InputError(f"{self.location} holds no map: `semgp build` makes one.")
        wanted = numbers[-1] if number is None else number
        if wanted not in numbers:
            raise InputError(f"{self.location} has no version {wanted}, but {_listed(numbers)}.")
        name = _manifest_name(wanted)
        try:
            manifest = Manifest.from_bytes(self.files.read(name))
            if manifest.number != wanted:
                raise InputError(f"is damaged: it says that it is version {manifest.number}.")
        except FileFormatError:
            raise
        except InputError as error:
            hint = "" if len(numbers) < 2 else " Other versions may be whole: `semgp store versions`."
            raise FileFormatError(f"{self.location}/{name}", f"{error}{hint}") from error
        return manifest

    def publish(self, manifest: Manifest, note: str = "") -> Manifest:
        """Create the version that follows a manifest's number, of its tiles, and return its manifest.

        Raises
        ------
        ConflictError
            That version is there: another writer was faster.
        """
        time = datetime.now(UTC).isoformat(timespec="milliseconds")
        following = replace(manifest, number=manifest.number + 1, time=time, note=note)
        if not self.files.create(_manifest_name(following.number), following.to_bytes()):
            raise ConflictError(
                f"{self.location}: another writer has made version {following.number} since version "
                f"{manifest.number} was read. Merge with it, or open the map anew and try again."
            )
        return following

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
            raise FileFormatError(f"{self.location}/{name}", str(error)) from error
        return arrays

    def roll_back(self, number: int, note: str = "") -> Manifest:
        """Publish an older version again, as the newest; the ones in between stay.

        Raises
        ------
        InputError
            No such version; ConflictError if another writer was faster.
        """
        old, newest = self.manifest(number), self.numbers()[-1]
        return self.publish(replace(old, number=newest), note or f"version {number} again")

    def prune(self, keep: int) -> int:
        """Remove all but the newest versions, and tile files that none of those lists; return how many of these.

        Maps that are open at an older version lose what they have not loaded yet.

        Raises
        ------
        InputError
            Fewer than one version to keep, or another writer at work.
        """
        if keep < 1:
            raise InputError(f"at least one version must be kept, not {keep}.")
        lock = self.files.lock()
        try:
            if lock.alone is False:
                raise InputError(f"{self.location}: another writer is at work: try again when it has ended.")
            for number in self.numbers()[:-keep]:
                self.files.remove(_manifest_name(number))
            return self.clean()
        finally:
            lock.release()

    def clean(self, older: float = 0.0) -> int:
        """Remove tile files that no version lists and that are so many seconds old; return how many.

        For a writer that is alone: others may be about to list them. Writers of a folder do it by themselves.
        """
        listed = {t.name(key) for n in self.numbers() for key, t in self.manifest(n).tiles.items()}
        tiles = filter(_TILE.fullmatch, self.files.names("tiles"))  # and nothing that others have put there
        orphans = [f"tiles/{name}" for name in tiles if name not in listed]
        gone = [name for name in orphans if older == 0 or self.files.age(name) >= older]
        for name in gone:
            self.files.remove(name)
        return self.files.remove_partial() + len(gone)

    def tidy(self) -> None:
        """Remove what no version lists, where there is no other writer and that can be told."""
        with self.writing():
            pass

    def check(self, number: int | None = None) -> Iterator[FileFormatError]:
        """Read every tile of a version, and yield what is wrong with those that are damaged."""
        manifest = self.manifest(number)

        def look(item: tuple[int, Tile]) -> FileFormatError | None:
            try:
                self.get(*item, manifest.settings)
            except FileFormatError as error:
                return error
            return None

        yield from filter(None, parallel_map(look, manifest.tiles.items()))

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Count as a writer for the length of a block.

        The first one removes what writers that died have left, where that can be told and all manifests are whole.
        """
        lock = self.files.lock()
        try:
            if lock.alone:
                with suppress(FileFormatError):
                    self.clean()
                lock.share()
            yield
        finally:
            lock.release()


def _manifest_name(number: int) -> str:
    return f"manifests/{number:08d}.json"


def _listed(numbers: list[int]) -> str:
    return f"{numbers[0]}" if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"
