"""The Gaussian-process semantic map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.model import GPModel
from semgp.maps.blocks import ManyBlocks
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.occupancy import FREE, OCCUPIED, Occupancy
from semgp.maps.presets import GENERAL
from semgp.maps.protocol import NO_FREE_SPACE, query_points, require_classes
from semgp.maps.settings import require_data
from semgp.maps.whole import WholeScan
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.upward import Up


class GPSemanticMap:
    """Continuous semantic map: class probabilities and uncertainty at any point.

    The model decides how labels become a posterior. With a `BlockModel`, the map for real work, the labels of all
    scans add up in sites, in many blocks; only blocks whose data changed are solved again, when they are next
    asked. With a `GPModel`, the paper's map (section IV), a subset of the labels is one training set: one block.
    Updates never change the model.

    Parameters
    ----------
    classes : Classes
        The map's classes, any number.
    model : BlockModel or GPModel, optional
        Left out, the preset `GENERAL`. See `semgp.maps.presets`, `semgp.blocks.learning` and, for the paper's,
        `semgp.maps.learning`.
    tolerance : float, optional
        For live maps: cells of a block map whose sites have changed by less than this on average since they were
        last solved are left as they are. At 0, answers are exact, whatever the order of updates. Around 0.2, a
        label changed in five or the number of labels grown by half, saves most of the work of a scan.
    free : FreeSpace, optional
        For block maps that keep free space, too, from the rays of clouds with a pose. Predictions then have an
        `occupancy`: class c is there with probability `occupancy.probability * probability[:, c]`.
    forgetting : Forgetting, optional
        For maps with free space that forget what was long ago and what rays pass through. Answers then depend on
        the order of updates.

    Raises
    ------
    InputError
        A model for another number of classes, a tolerance that is negative, free space for a `GPModel`, or
        forgetting without free space.
    """

    kind = "gp"
    up: Up = "z"

    def __init__(
        self,
        classes: Classes,
        model: BlockModel | GPModel | None = None,
        tolerance: float = 0.0,
        *,
        free: FreeSpace | None = None,
        forgetting: Forgetting | None = None,
    ) -> None:
        if not (math.isfinite(tolerance) and tolerance >= 0):
            raise InputError(f"the tolerance must be a number, 0 or above, not {tolerance}.")
        self.classes = classes
        self.model = GENERAL if model is None else model
        self._state = _state(classes, self.model, free, forgetting)
        self._tolerance = tolerance
        if isinstance(self._state, ManyBlocks):
            self._state.tolerance = tolerance

    def update(self, cloud: LabelledCloud) -> None:
        """Add the labelled points of a cloud; the posterior follows at the next query.

        Raises
        ------
        InputError
            Classes that differ from the map's, features or a pose missing, or points too far from the first.
        """
        require_classes(cloud, self.classes)
        self._state.add(cloud)

    def query(self, points: ArrayLike, features: ArrayLike | None = None) -> Prediction:
        """Return class probabilities, latent mean and variance at points.

        Parameters
        ----------
        points : (M, 3) array
            Metres, world frame.
        features : (M, F) array, optional
            The model's inputs beyond position. Where they are NaN, or left out, a point takes those of the nearest
            member of its block.

        Raises
        ------
        InputError
            Points or features that cannot be used, or a map without a single labelled point.
        """
        require_data(self._state.n_known)
        known = None if features is None else np.ascontiguousarray(features, dtype=np.float32)
        return self._state.answer(query_points(points), known)

    def occupancy(self, points: ArrayLike) -> OccupancyPrediction:
        """Return whether something is there, at points (M, 3), metres, world frame: `query` without the classes.

        Raises
        ------
        InputError
            Points that cannot be used, or a map that keeps no free space.
        """
        return self._occupancy.answer(query_points(points), self._tolerance)

    def solve(self) -> None:
        """Bring the posterior up to date now instead of at the next query."""
        self._state.solve()

    def crop(self, low: ArrayLike, high: ArrayLike) -> GPSemanticMap:
        """Return the map of what lies in a box, from `low` (included) to `high` (left out), metres.

        Near the border its answers differ from the whole map's: what lay outside is forgotten.

        Raises
        ------
        InputError
            Corners that are not three numbers each, or not in order.
        """
        a, b = box(low, high)
        part = GPSemanticMap(self.classes, self.model)
        part._state = self._state.crop(lambda X: np.asarray(((a <= X) & (b > X)).all(axis=1)))
        part.up = self.up
        return part

    @property
    def resolution(self) -> float:
        """Edge in metres of the voxels in which a block map collects its labels.

        Raises
        ------
        InputError
            The paper's map, which has none.
        """
        if not isinstance(self.model, BlockModel):
            raise InputError("a map of one training set has no resolution: give GPSemanticMap a BlockModel.")
        return self.model.resolution

    @property
    def free(self) -> FreeSpace | None:
        """How free space is kept, None where it is not."""
        return self._state.free if isinstance(self._state, ManyBlocks) else None

    @property
    def occupied_positions(self) -> NDArray[np.float64]:
        """Sites (n, 3) at which most rays ended, metres, world frame.

        Raises
        ------
        InputError
            A map that keeps no free space.
        """
        return self._occupancy.positions(OCCUPIED)

    @property
    def free_positions(self) -> NDArray[np.float64]:
        """Sites (n, 3) that most rays passed, metres, world frame.

        Raises
        ------
        InputError
            A map that keeps no free space.
        """
        return self._occupancy.positions(FREE)

    @property
    def many_blocks(self) -> ManyBlocks | None:
        """The sites and blocks of a map for real work, None for the paper's."""
        return self._state if isinstance(self._state, ManyBlocks) else None

    @property
    def _occupancy(self) -> Occupancy:
        occupancy = self._state.occupancy if isinstance(self._state, ManyBlocks) else None
        if occupancy is None:
            raise InputError(NO_FREE_SPACE)
        return occupancy

    @property
    def positions(self) -> NDArray[np.float64]:
        """Sites or labelled points (n, 3), metres."""
        return self._state.positions

    def __len__(self) -> int:
        """Return the number of sites, or of labelled points."""
        return len(self._state)

    def info(self) -> dict[str, Any]:
        """Return the model, counts and memory, ready for JSON."""
        described = {"kind": self.kind, "classes": list(self.classes.names), "model": self.model.to_json()}
        return described | self._state.info()

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return a header ready for JSON and plain arrays from which `from_arrays` makes the same map."""
        header, arrays = self._state.to_arrays()
        return {"blocks": isinstance(self.model, BlockModel), **header}, arrays

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the map again from what `to_arrays` gave.

        Raises
        ------
        InputError
            A header or arrays that do not belong together.
        """
        state = (ManyBlocks if header["blocks"] else WholeScan).from_arrays(classes, header, arrays)
        return cls.of_state(state)

    @classmethod
    def of_state(cls, state: ManyBlocks | WholeScan) -> Self:
        """Make a map of its blocks or its training set."""
        made = cls(state.classes, state.model)
        made._state = state
        return made


def box(low: ArrayLike, high: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Check the corners of a box and return them as float64, shape (3,) each.

    Raises
    ------
    InputError
        Corners that are not three numbers each, or not in order.
    """
    a, b = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    if a.shape != (3,) or b.shape != (3,) or not (a < b).all():
        raise InputError(f"a box needs two corners (3,), each below the other, not {a.tolist()} and {b.tolist()}.")
    return a, b


def _state(
    classes: Classes, model: BlockModel | GPModel, free: FreeSpace | None, forgetting: Forgetting | None
) -> ManyBlocks | WholeScan:
    if isinstance(model, BlockModel):
        return ManyBlocks(classes, model, free, forgetting)
    if free is not None or forgetting is not None:
        raise InputError("free space and forgetting need a map of many blocks: give GPSemanticMap a BlockModel.")
    if isinstance(model, GPModel):
        return WholeScan(classes, model)
    raise InputError(f"the model must be a BlockModel or a GPModel, not {type(model).__name__}.")
