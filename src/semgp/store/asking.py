"""Asking: many points of a stored map, answered piece by piece by any executor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.blocks.arrays import F64
from semgp.errors import InputError
from semgp.executors import Executor, Steps
from semgp.executors.protocol import no_steps
from semgp.maps.protocol import query_points
from semgp.maps.settings import require_data
from semgp.prediction import Prediction
from semgp.store.groups import groups, in_order
from semgp.store.manifest import Manifest, Tile
from semgp.store.store import MapStore
from semgp.store.working_set import WorkingSet

PIECE_SITES = 200_000
"""Sites that a piece of work loads at most, unless one tile's points need more: some hundred MB once solved."""

PIECE_POINTS = 500_000
"""Points of a piece of work at most."""


@dataclass(frozen=True)
class Piece:
    """Points that lie together, and the tiles that their answers depend on."""

    points: F64
    features: NDArray[np.float32] | None
    tiles: dict[int, Tile]


@dataclass(frozen=True)
class AskTiles:
    """The work: load a piece's tiles, and answer its points. The manifest is the version's, without its tiles."""

    store: MapStore
    manifest: Manifest

    def __call__(self, piece: Piece) -> Prediction:
        """Return the answers at the points of a piece."""
        sites = sum(tile.all_sites for tile in piece.tiles.values())
        working = WorkingSet(self.store, replace(self.manifest, tiles=piece.tiles), max(sites, 1))
        working.hold(np.array(list(piece.tiles), dtype=np.int64))
        return working.state.answer(piece.points, piece.features)


def query(
    store: MapStore,
    points: ArrayLike,
    executor: Executor,
    *,
    features: ArrayLike | None = None,
    version: int | None = None,
    steps: Steps = no_steps,
) -> Prediction:
    """Return class probabilities and variance at points, as `StoredMap.query` does, to rounding.

    Each worker loads the tiles of its pieces and no others.

    Parameters
    ----------
    store : MapStore
        With a map; the workers must reach it, too.
    points : (M, 3) array
        Metres, world frame.
    executor : Executor
        Who does the work.
    features : (M, F) array, optional
        See `StoredMap.query`.
    version : int, optional
        The newest by default.
    steps : callable, optional
        Called for each piece of work that is done.

    Raises
    ------
    InputError
        Points or features that cannot be used, or a map without a labelled point; FileFormatError for tiles that
        are damaged.
    """
    X = query_points(points)
    known = None if features is None else np.ascontiguousarray(features, dtype=np.float32)
    if known is not None and len(known) != len(X):
        raise InputError(f"features of {len(known)} points do not go with {len(X)} points.")
    manifest = store.manifest(version)
    require_data(manifest.sites + manifest.free_sites)
    all_rows, pieces = [], []
    sizes = {key: tile.all_sites for key, tile in manifest.tiles.items()}
    origin = np.array(manifest.origin, dtype=np.int64)
    for rows, near in groups(X, manifest.settings, origin, sizes, PIECE_SITES, PIECE_POINTS):
        tiles = {key: manifest.tiles[key] for key in near.tolist() if key in manifest.tiles}
        pieces.append(Piece(X[rows], None if known is None else known[rows], tiles))
        all_rows.append(rows)
    work = AskTiles(store, replace(manifest, tiles={}))
    return in_order(executor.map(work, pieces, steps), all_rows)
