"""The stored map: a Gaussian-process map of any size, of which only what is asked for is in memory."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import numpy as np

from semgp.blocks.arrays import I64
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.protocol import require_classes
from semgp.store.commit import commit
from semgp.store.contents import describe
from semgp.store.settings import Settings
from semgp.store.store import MapStore
from semgp.store.tiled_map import TiledMap
from semgp.store.working_set import WorkingSet

MOST_SITES = 4_000_000
"""Sites in memory by default: about 2.5 GB once all of them are solved."""


class StoredMap(TiledMap):
    """A map of many blocks in a store: the answers of a `GPSemanticMap` from a part of its memory.

    Queries and updates load the tiles that they touch, and drop those not used for longest. Where all tiles that a
    call needs fit, its answers are those of the map in memory to the last bit; else its points are answered in
    groups, which moves last bits of single precision. Updates are in memory, or in files that nobody else sees,
    until `commit` publishes them as the next version. Readers never wait, and see the version they have opened
    until they `refresh`. One object is for one thread at a time.

    >>> with StoredMap.create("drive", Settings(classes, model)) as drive:  # doctest: +SKIP
    ...     for scan in scans:
    ...         drive.update(scan)
    ...     drive.commit("first drive")
    >>> StoredMap("drive").query(points)  # doctest: +SKIP

    Parameters
    ----------
    store : MapStore, str or Path
        The store, its folder or its URL.
    version : int, optional
        The newest by default.
    most_sites : int, optional
        So many sites may be in memory; a single call that needs more has them.

    Raises
    ------
    InputError
        No map there, or no such version; FileFormatError for a damaged manifest.
    """

    def __init__(
        self, store: MapStore | str | Path, version: int | None = None, *, most_sites: int = MOST_SITES
    ) -> None:
        if most_sites < 1:
            raise InputError(f"most_sites must be at least 1, not {most_sites}.")
        self.store = store if isinstance(store, MapStore) else MapStore(store)
        super().__init__(WorkingSet(self.store, self.store.manifest(version), most_sites))
        self._clouds = 0
        self._writing, self._is_writing = ExitStack(), False

    @classmethod
    def create(
        cls, store: MapStore | str | Path, settings: Settings, *, most_sites: int = MOST_SITES, note: str = ""
    ) -> Self:
        """Begin a map in an empty place, and open it.

        Raises
        ------
        InputError
            There is a map already, or the place cannot be written to.
        """
        store = store if isinstance(store, MapStore) else MapStore(store)
        store.create(settings, note)
        return cls(store, most_sites=most_sites)

    @property
    def version(self) -> int:
        """The version that the map was opened at, or that it published last."""
        return self._working.base.number

    def update(self, cloud: LabelledCloud) -> None:
        """Add the labelled points of a cloud and, where free space is kept, what its rays tell.

        Raises
        ------
        InputError
            As `GPSemanticMap.update`; FileFormatError for tiles that are damaged, ConflictError where the version
            that the map is open at has been removed. The map is then as before.
        """
        require_classes(cloud, self.classes)
        self._begin_writing()
        try:
            self._add(cloud)
        except Exception:
            if not self._clouds:
                self.close()  # no writer yet: others need not wait
            raise

    def _add(self, cloud: LabelledCloud) -> None:
        if not len(cloud):
            self._clouds += 1
            return
        self._working.hold(self._touched(cloud))
        self._working.state.add(cloud)
        self._working.mark()
        self._clouds += 1
        self._working.make_room()

    def _begin_writing(self) -> None:
        """Count as a writer: from now on, until `close`, nobody removes a version."""
        if self._is_writing:
            return
        with ExitStack() as begun:
            begun.enter_context(self.store.writing())
            self.store.require_still(self.version)
            self._writing = begun.pop_all()
        self._is_writing = True

    def _touched(self, cloud: LabelledCloud) -> I64:
        """The tiles that a cloud may change; rays stay within the box round their ends."""
        working, tiling, origin = self._working, self.settings.tiling, self._working.state.origin
        if origin is None:
            return np.empty(0, dtype=np.int64)
        if self.free is None or cloud.origin is None:
            return tiling.of_points(cloud.points[cloud.labelled], self.resolution, origin)
        ends = np.vstack([cloud.points, cloud.origin])
        tiles = np.array(sorted(working.tiles), dtype=np.int64)
        return tiles[tiling.overlap(tiles, origin, ends.min(axis=0), ends.max(axis=0), self.resolution)]

    def commit(self, note: str = "", *, merge: bool = True) -> int:
        """Publish all updates as the next version, and return its number; without updates, the present one.

        Parameters
        ----------
        note : str, optional
            What to say of the version.
        merge : bool, optional
            Where another writer has published since, add up what both have; False to raise instead.

        Raises
        ------
        ConflictError
            Both cannot be added up, see `semgp.store.commit.commit`. The updates are still there.
        """
        if self._clouds or self._working.is_changed:
            commit(self._working, self._clouds, note, merge)
            self._clouds = 0
        self.close()
        return self.version

    def refresh(self) -> int:
        """Go on with the newest version, keep what is in memory and has not changed, and return its number.

        Raises
        ------
        InputError
            Updates that are not committed.
        """
        if self._clouds:
            raise InputError("the map has updates that are not committed: commit them first.")
        self._working.move_to(self.store.manifest())
        return self.version

    def close(self) -> None:
        """Let go of the writers' lock, and forget updates that are not committed.

        Some of them may be in files of no version, which the next writer removes.
        """
        if self._clouds or self._working.is_changed:
            self._working.move_to(self._working.base)
            self._clouds = 0
        self._writing.close()
        self._is_writing = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Commit after a block that ended well, and forget its updates otherwise."""
        try:
            if kind is None:
                self.commit()
        finally:
            self.close()

    @property
    def clouds(self) -> int:
        """How many clouds the map has taken in."""
        return self._working.base.clouds + self._clouds

    def info(self) -> dict[str, Any]:
        """Return version, model, counts and memory, ready for JSON; tiles are not read."""
        return describe(self.store, self._working.base) | self._working.info()
