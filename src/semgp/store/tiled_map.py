"""A map in tiles: what it is asked, tile by tile, from those in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from semgp.blocks.arrays import F64, I64
from semgp.blocks.model import BlockModel
from semgp.errors import InputError
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap, box
from semgp.maps.occupancy import FREE, OCCUPIED
from semgp.maps.protocol import NO_FREE_SPACE, query_points
from semgp.maps.settings import require_data
from semgp.maps.tiles import Arrays
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.store.contents import in_memory, labelled_positions, space_positions
from semgp.store.groups import groups, in_order, occupancy_in_order
from semgp.store.settings import Settings
from semgp.store.working_set import WorkingSet
from semgp.upward import Up

P = TypeVar("P")


class TiledMap:
    """Answers from a working set of tiles.

    Parameters
    ----------
    working : WorkingSet
        Loads the tiles.
    """

    kind = "gp"

    def __init__(self, working: WorkingSet) -> None:
        self._working, self.classes = working, working.settings.classes

    @property
    def settings(self) -> Settings:
        """Classes, model and all else that never changes."""
        return self._working.settings

    @property
    def model(self) -> BlockModel:
        """The map's model."""
        return self.settings.model

    @property
    def free(self) -> FreeSpace | None:
        """How free space is kept, None where it is not."""
        return self.settings.free

    @property
    def up(self) -> Up:
        """The axis of the world that points upwards."""
        return self.settings.up

    @property
    def resolution(self) -> float:
        """Edge in metres of the voxels in which the map collects its labels."""
        return self.settings.resolution

    @property
    def origin(self) -> I64 | None:
        """The voxel (3,) where the keys of the sites begin, None for an empty map."""
        return self._working.state.origin

    def parts(self) -> Iterator[tuple[int, Arrays]]:
        """Yield keys and stored arrays of all tiles, one after the other: see `semgp.maps.tiles`."""
        yield from self._working.parts()

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
        for rows, tiles in groups(X, self.settings, working.state.origin, working.sizes, working.most_sites):
            working.hold(tiles)
            parts.append(answer(rows))
            all_rows.append(rows)
        return parts, all_rows

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
