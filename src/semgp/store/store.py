"""The store: versions and tiles of one map in a folder or bucket, and what keeps house there."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from semgp.errors import FileFormatError, InputError
from semgp.parallel import parallel_map
from semgp.store.bucket import open_files
from semgp.store.files import Files
from semgp.store.manifest import Manifest, Tile
from semgp.store.settings import Settings
from semgp.store.tiles import Tiles
from semgp.store.versions import Versions, manifest_name


class MapStore(Versions, Tiles):
    """A folder or bucket with the versions of one map.

    `tiles/` holds immutable files of sites, `manifests/` one file a version, see `Tiles` and `Versions`. Readers
    need no lock. Writers of a folder share one, so that files are removed only where nobody can be about to list
    them; in a bucket, and on systems without such locks, writers cannot be seen.

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
        super().__init__(open_files(location) if files is None else files)

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

    def tidy(self) -> None:
        """Remove what no version lists, where there is no other writer and that can be told."""
        with self.writing():
            pass

    @property
    def sees_writers(self) -> bool:
        """Whether other writers can be told to be at work: in folders, but for systems without locks of files."""
        lock = self.files.lock()
        lock.release()
        return lock.alone is not None

    def roll_back(self, number: int, note: str = "") -> Manifest:
        """Publish an older version again, as the newest; the ones in between stay.

        Raises
        ------
        InputError
            No such version; ConflictError where another writer was faster.
        """
        old = self.manifest(number)
        with self.writing():
            self.require_still(number)
            return self.publish(replace(old, number=self.numbers()[-1]), note or f"version {number} again")

    def drop(self, numbers: Collection[int]) -> int | None:
        """Remove versions, the newest never, and tile files that no other one lists; return how many of these.

        While another writer is at work, which may be about to list these files, nothing is removed and None is
        returned. Where writers cannot be seen, the caller must know that there is none.

        Manifests go before tiles: whoever is killed meanwhile leaves whole versions, and files that the next
        writer removes. Maps that are open at a version that is gone raise ConflictError once they need more of it.
        """
        lock = self.files.lock()
        try:
            if lock.alone is False:
                return None
            old = [manifest_name(number) for number in self.numbers()[:-1] if number in numbers]
            parallel_map(self.files.remove, old, self.files.at_once)
            return self.clean()
        finally:
            lock.release()

    def prune(self, keep: int) -> int:
        """Drop all but the newest versions, see `drop`, and return how many tile files that were.

        Raises
        ------
        InputError
            Fewer than one version to keep, or another writer at work.
        """
        if keep < 1:
            raise InputError(f"at least one version must be kept, not {keep}.")
        removed = self.drop(self.numbers()[:-keep])
        if removed is None:
            raise InputError(f"{self.location}: another writer is at work: try again when it has ended.")
        return removed

    def clean(self, older: float = 0.0) -> int:
        """Remove tile files that no version lists and that are so many seconds old; return how many.

        For a writer that is alone: others may be about to list them. Writers of a folder do it by themselves.
        """
        at_once = self.files.at_once
        manifests = parallel_map(self.manifest, self.numbers(), at_once)
        orphans = self.orphans({tile.name(key) for manifest in manifests for key, tile in manifest.tiles.items()})
        ages = parallel_map(self.files.age, orphans, at_once) if older else [0.0] * len(orphans)
        gone = [name for name, age in zip(orphans, ages) if age >= older]
        parallel_map(self.files.remove, gone, at_once)
        return self.files.remove_partial() + len(gone)

    def check(self, number: int | None = None) -> Iterator[FileFormatError]:
        """Read every tile of a version, and yield what is wrong with those that are damaged."""
        manifest = self.manifest(number)

        def look(item: tuple[int, Tile]) -> FileFormatError | None:
            try:
                self.get(*item, manifest.settings)
            except FileFormatError as error:
                return error
            return None

        yield from filter(None, parallel_map(look, manifest.tiles.items(), self.files.at_once))
