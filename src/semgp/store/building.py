"""Building: many clouds into a stored map, by any executor.

Sums add up, so clouds are taken apart, cloud by cloud and tile by tile, and put together again in any order: first
each worker sums a few clouds, then each tile is written by one worker, with what all of them have for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from semgp.blocks.arrays import I64
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.executors import Executor, Steps
from semgp.executors.protocol import no_steps
from semgp.maps.protocol import require_classes
from semgp.maps.tiles import Arrays, changed_tiles, cut
from semgp.parallel import n_workers, parallel_map
from semgp.store.manifest import Manifest, Tile, voxel
from semgp.store.merge import added
from semgp.store.settings import Settings
from semgp.store.store import MapStore

Part = dict[int, Arrays]
"""What some clouds add to some tiles."""

BATCH = 8
"""Clouds a worker between one version and the next."""

_CHUNK = 4  # clouds that one piece of work sums up: fewer parts to put together


@dataclass(frozen=True)
class SumClouds:
    """The first step: a few clouds, as what they add to each tile, the tiles dealt to `n_parts` parts."""

    clouds: Sequence[LabelledCloud]
    settings: Settings
    origin: I64
    n_parts: int

    def __call__(self, rows: range) -> list[Part]:
        """Return the parts of the clouds of these rows."""
        state = self.settings.new_state()
        state.begin(self.origin, None)
        for i in rows:
            cloud = self.clouds[i]
            require_classes(cloud, self.settings.classes)
            state.add(cloud)
        tiles = changed_tiles(state, self.settings.tiling)
        parts: list[Part] = [{} for _ in range(self.n_parts)]
        for tile, arrays in cut(state, self.settings.tiling, tiles).items():
            parts[_part_of(tile, self.settings, self.n_parts)][tile] = arrays
        return parts


@dataclass(frozen=True)
class WriteTiles:
    """The second step: all that clouds add to the tiles of one part, and what they had, as new files."""

    store: MapStore
    manifest: Manifest

    def __call__(self, parts: list[Part]) -> dict[int, Tile]:
        """Write the tiles of the parts, and return their files."""
        if self.manifest.number not in self.store.numbers():
            raise InputError(
                f"{self.store.location}: a worker does not see version {self.manifest.number}. All machines must "
                "reach the store by the same path or URL."
            )
        tiles = sorted({tile for part in parts for tile in part})
        at_once = max(1, self.store.files.at_once // n_workers())  # for each of the workers of this process
        return dict(zip(tiles, parallel_map(lambda tile: self._write(tile, parts), tiles, at_once)))

    def _write(self, tile: int, parts: list[Part]) -> Tile:
        old = self.manifest.tiles.get(tile)
        before = [] if old is None else [self.store.get(tile, old, self.manifest.settings)]
        return self.store.put(tile, added([*before, *(part[tile] for part in parts if tile in part)]))


def build(
    store: MapStore,
    clouds: Sequence[LabelledCloud],
    executor: Executor,
    *,
    note: str = "",
    batch: int = BATCH,
    steps: Steps = no_steps,
) -> Manifest:
    """Add clouds to a stored map, in one version for each batch, and return the last one's manifest.

    The map is the same, file by file, as by `StoredMap.update`, whatever the executor, the number of workers and
    the batch. After an interruption, the versions so far hold the first clouds: `Manifest.clouds` says how many.

    Parameters
    ----------
    store : MapStore
        With a map.
    clouds : sequence of LabelledCloud
        Read by the workers, each once.
    executor : Executor
        Who does the work.
    note : str, optional
        For the manifests.
    batch : int, optional
        Clouds a worker and version.
    steps : callable, optional
        Called with the number of clouds that are done.

    Raises
    ------
    InputError
        A map that forgets, for which the order of clouds matters, or clouds that it refuses; ConflictError where
        another writer publishes meanwhile.
    """
    manifest = store.manifest()
    if manifest.settings.forgetting is not None:
        raise InputError(
            "the answers of a map that forgets depend on the order of its clouds: update it one by one."
        )
    with store.writing():
        size = batch * executor.n_workers
        for start in range(0, len(clouds), size):
            rows = range(start, min(start + size, len(clouds)))
            manifest = _add(store, manifest, clouds, rows, executor, note, steps)
    return manifest


def _add(
    store: MapStore,
    manifest: Manifest,
    clouds: Sequence[LabelledCloud],
    rows: range,
    executor: Executor,
    note: str,
    steps: Steps,
) -> Manifest:
    """Publish a version with some clouds more."""
    origin = manifest.origin or _origin_of(clouds, rows, manifest.settings)
    tiles = dict(manifest.tiles)
    if origin is not None:
        chunk = max(1, min(_CHUNK, len(rows) // (2 * executor.n_workers)))
        chunks = [rows[i : i + chunk] for i in range(0, len(rows), chunk)]
        n_parts = 2 * executor.n_workers
        work = SumClouds(clouds, manifest.settings, np.array(origin, dtype=np.int64), n_parts)

        def done(n: int) -> None:
            steps(n * chunk)

        for written in executor.shuffle(work, chunks, WriteTiles(store, manifest), n_parts, done):
            tiles |= written
    more = replace(manifest, tiles=tiles, origin=origin, clouds=manifest.clouds + len(rows))
    return store.publish(more, note)


def _origin_of(clouds: Sequence[LabelledCloud], rows: range, settings: Settings) -> tuple[int, int, int] | None:
    """Where a map that begins with these clouds has its origin, as `ManyBlocks.add` would choose it."""
    state = settings.new_state()
    for i in rows:
        require_classes(clouds[i], settings.classes)
        state.add(clouds[i])
        if state.origin is not None:
            break
    return voxel(state.origin)


def _part_of(tile: int, settings: Settings, n_parts: int) -> int:
    """Deal tiles to parts, neighbours to different ones."""
    place = tile >> settings.tiling.bits
    return (place + (place >> 21) * 3 + (place >> 42) * 7) % n_parts
