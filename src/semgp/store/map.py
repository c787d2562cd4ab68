"""The stored map: a Gaussian-process map of any size, of which only what is asked for is in memory."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from semgp.blocks.arrays import F64, I64
from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap, box
from semgp.maps.occupancy import FREE, OCCUPIED
from semgp.maps.protocol import NO_FREE_SPACE, query_points, require_classes
from semgp.maps.settings import require_data
from semgp.maps.tiles import Arrays
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.store.commit import commit
from semgp.store.contents import describe, in_memory, labelled_positions, space_positions
from semgp.store.groups import groups, in_order, occupancy_in_order
from semgp.store.manifest import Settings
from semgp.store.store import MapStore
from semgp.store.working_set import WorkingSet

P = TypeVar("P")

MOST_SITES = 4_000_000
"""Sites in memory by default: about 2.5 GB once all of them are solved."""


class StoredMap:
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

    kind = "gp"

    def __init__(
        self, store: MapStore | str | Path, version: int | None = None, *, most_sites: int = MOST_SITES
    ) -> None:
        if most_sites < 1:
            raise InputError(f"most_sites must be at least 1, not {most_sites}.")
        self.store = store if isinstance(store, MapStore) else MapStore(store)
        self._base = self.store.manifest(version)
        self._working = WorkingSet(self.store, self._base, most_sites)
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
    def settings(self) -> Settings:
        """Classes, model and all else that never changes."""
        return self._base.settings

    @property
    def classes(self) -> Classes:
        """The map's classes."""
        return self.settings.classes

    @property
    def model(self) -> BlockModel:
        """The map's model."""
        return self.settings.model

    @property
    def free(self) -> FreeSpace | None:
        """How free space is kept, None where it is not."""
        return self.settings.free

    @property
    def resolution(self) -> float:
        """Edge in metres of the voxels in which the map collects its labels."""
        return self.settings.resolution

    @property
    def version(self) -> int:
        """The version that the map was opened at, or that it published last."""
        return self._base.number

    def update(self, cloud: LabelledCloud) -> None:
        """Add the labelled points of a cloud and, where free space is kept, what its rays tell.

        Raises
        ------
        InputError
            As `GPSemanticMap.update`; FileFormatError for tiles that are damaged. The map is then as before.
        """
        require_classes(cloud, self.classes)
        if not len(cloud):
            return
        if not self._is_writing:
            self._writing.enter_context(self.store.writing())
            self._is_writing = True
        self._working.hold(self._touched(cloud))
        self._working.state.add(cloud)
        self._working.mark()
        self._working.make_room()
        self._clouds += 1

    def _touched(self, cloud: LabelledCloud) -> I64:
        """The tiles that a cloud may change; rays stay within the box round their ends."""
        working, tiling, origin = self._working, self.settings.tiling, self._working.state.origin
        if origin is None:
            return np.empty(0, dtype=np.int64)
        if self.free is None or cloud.origin is None:
            return tiling.of_points(cloud.points, self.resolution, origin)
        ends = np.vstack([cloud.points, cloud.origin])
        tiles = np.array(sorted(working.tiles), dtype=np.int64)
        return tiles[tiling.overlap(tiles, origin, ends.min(axis=0), ends.max(axis=0), self.resolution)]

    def query(self, points: ArrayLike, features: ArrayLike | None = None) -> Prediction:
        """Return class probabilities and variance at points, see `GPSemanticMap.query`.

        Raises
        ------
        InputError
            Points or features that cannot be used, or a map without a labelled point; FileFormatError for tiles
            that are damaged.
        """
        X = query_points(points)
        known = None if features is None else np.ascontiguousarray(features, dtype=np.float32)
        answer = self._working.state.answer
        return in_order(*self._in_groups(X, lambda s: answer(X[s], None if known is None else known[s])))

    def occupancy(self, points: ArrayLike) -> OccupancyPrediction:
        """Return whether something is there, see `GPSemanticMap.occupancy`.

        Raises
        ------
        InputError
            Points that cannot be used, or a map that keeps no free space.
        """
        self._require_free_space()
        X, state = query_points(points), self._working.state
        return occupancy_in_order(*self._in_groups(X, lambda s: state.occupancy_at(X[s])))

    def _in_groups(self, X: F64, answer: Callable[[I64], P]) -> tuple[list[P], list[I64]]:
        """Answer group by group, each with its tiles in memory; return the answers and their rows."""
        working = self._working
        require_data(working.n_sites)
        assert working.state.origin is not None
        parts, all_rows = [], []
        for rows, tiles in groups(
            X, self.settings.tiling, self.resolution, working.state.origin, self.settings.half_blend,
            working.sizes, working.most_sites,
        ):  # fmt: skip
            working.hold(tiles)
            parts.append(answer(rows))
            all_rows.append(rows)
        return parts, all_rows

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
            self._base = commit(self._working, self._base, self._clouds, note, merge)
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
        newest = self.store.manifest()
        origin = None if newest.origin is None else np.array(newest.origin, dtype=np.int64)
        self._working.move_to(newest.tiles, origin, newest.clock)
        self._base = newest
        return self.version

    def close(self) -> None:
        """Let go of the writers' lock. Updates that are not committed stay in memory."""
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

    def load(self) -> GPSemanticMap:
        """Return the whole map in memory."""
        state = self._working.state
        return in_memory(self.settings, self._working.parts(), state.origin, state.clock)

    def crop(self, low: ArrayLike, high: ArrayLike) -> GPSemanticMap:
        """Return the map of what lies in a box in memory, see `GPSemanticMap.crop`; other tiles are not touched.

        Raises
        ------
        InputError
            Corners that are not three numbers each, or not in order.
        """
        a, b = box(low, high)
        state = self._working.state
        parts = self._working.parts(a, b)
        return in_memory(self.settings, parts, state.origin, state.clock).crop(a, b)

    @property
    def positions(self) -> F64:
        """Sites (n, 3), metres, world frame."""
        return self._gathered(labelled_positions)

    @property
    def occupied_positions(self) -> F64:
        """Sites (n, 3) at which most rays ended, metres, world frame."""
        self._require_free_space()
        return self._gathered(partial(space_positions, label=OCCUPIED))

    @property
    def free_positions(self) -> F64:
        """Sites (n, 3) that most rays passed, metres, world frame."""
        self._require_free_space()
        return self._gathered(partial(space_positions, label=FREE))

    def _gathered(self, part: Callable[[Settings, Arrays, I64], F64]) -> F64:
        """The positions in all tiles, which are read one after the other."""
        origin = self._working.state.origin
        if origin is None:
            return np.empty((0, 3))
        found = [part(self.settings, arrays, origin) for _, arrays in self._working.parts()]
        return np.concatenate([np.empty((0, 3)), *found])

    def _require_free_space(self) -> None:
        if self.free is None:
            raise InputError(NO_FREE_SPACE)

    def __len__(self) -> int:
        """Return the number of sites of labels, as of the last version or of files written since."""
        return sum(tile.sites for tile in self._working.tiles.values())

    def info(self) -> dict[str, Any]:
        """Return version, model, counts and memory, ready for JSON; tiles are not read."""
        return describe(self.store, self._base) | self._working.info()
