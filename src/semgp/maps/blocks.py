"""The map for real work: every label of every scan, in many blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.arrays import I64, Bool
from semgp.blocks.cells import CELL, cell_origin
from semgp.blocks.field import Field
from semgp.blocks.inputs import cloud_inputs
from semgp.blocks.model import BlockModel
from semgp.blocks.stored import stored_sites
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.forgetting import Forgetting, faint
from semgp.maps.free_space import FreeSpace
from semgp.maps.occupancy import Occupancy
from semgp.maps.protocol import NO_FREE_SPACE
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.voxels import voxel_keys

UNEXPLAINED = 0.95
"""A point whose latent variance is above this share of the prior's counts as not observed."""


class ManyBlocks:
    """Sites in blocks, each with its posterior, solved again when its data change and it is asked.

    Parameters
    ----------
    classes : Classes
        The map's classes.
    model : BlockModel
        What is fixed for the life of the map.
    free : FreeSpace, optional
        For a map that keeps free space, too.
    forgetting : Forgetting, optional
        For a map that keeps free space and forgets.

    Raises
    ------
    InputError
        A model for another number of classes, settings of free space that do not go with it, or forgetting without
        free space.
    """

    def __init__(
        self,
        classes: Classes,
        model: BlockModel,
        free: FreeSpace | None = None,
        forgetting: Forgetting | None = None,
    ) -> None:
        if forgetting is not None and free is None:
            raise InputError(
                "a map that forgets needs to see what rays pass through: give it free=FreeSpace(), too."
            )
        self.forgetting = forgetting
        self.classes, self.model = classes, model
        self.tolerance = 0.0
        self._field = Field(model, len(classes))
        self.occupancy = None if free is None else Occupancy(free.of_resolution(model.resolution))

    def add(self, cloud: LabelledCloud) -> None:
        """Add the labelled points of a cloud and, where free space is kept, what its rays tell.

        Raises
        ------
        InputError
            Features that are missing, a pose that is needed, or points a million voxels from the first. The map is
            then as before.
        """
        inputs = cloud_inputs(cloud, self.model.features)
        if self.occupancy is None or not len(cloud):
            self._field.add(inputs)
            return
        self._field.require_usable(inputs)
        origin, forgetting, watched = self._origin(cloud), self.forgetting, np.empty(0, dtype=bool)
        sites, now = self._field.sites, 0.0
        if forgetting is not None:
            now = forgetting.clock(cloud, sites.clock)
            watched = self.occupancy.occupied(sites.voxels.keys[~faint(sites)])
        rays = self.occupancy.sample(cloud, origin, watched)
        for field in self.fields.values():
            field.sites.origin = origin
        if forgetting is not None:
            self._forget(forgetting, np.concatenate([rays.points, inputs.points]), rays.passed, now)
        self._field.add(inputs)
        self.occupancy.add(rays)

    def _origin(self, cloud: LabelledCloud) -> I64:
        """Where the keys of all fields begin: passed voxels are found in each."""
        return cell_origin(cloud.points, self.model.resolution) if self.origin is None else self.origin

    def _forget(self, forgetting: Forgetting, points: NDArray[np.float64], passed: I64, now: float) -> None:
        """Fade what a cloud comes near, and what its rays pass through."""
        origin = self._field.sites.origin
        assert self.occupancy is not None
        assert origin is not None
        keys = voxel_keys(points, self.model.resolution, origin)
        for field in self.fields.values():
            forgetting.fade(field, keys, now)
        forgetting.give_up(self.occupancy.field, passed)
        forgetting.give_up(self._field, self.occupancy.mostly_free(passed))
        self._drop_faint()

    def _drop_faint(self) -> None:
        """Begin the fields anew without the sites that are forgotten, once those are more than half of all."""
        for prefix, field in self.fields.items():
            gone = faint(field.sites)
            if 2 * np.count_nonzero(gone) > len(gone):
                self._begin(prefix, field.sites.only(~gone))

    def _begin(self, prefix: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Begin a field anew with stored sites of the same cells."""
        old = self.fields[prefix]
        field = Field(old.model, 2 if prefix else len(self.classes))
        field.sites.origin, field.sites.clock = old.sites.origin, old.sites.clock
        field.restore(arrays)
        field.touch(np.arange(len(field.sites.cells), dtype=np.int32))
        self._put(prefix, field)

    @property
    def clock(self) -> float | None:
        """The time, for maps that forget; None before the first cloud."""
        return self._field.sites.clock

    def _put(self, prefix: str, field: Field) -> None:
        if self.occupancy is not None and prefix:
            self.occupancy.field = field
        else:
            self._field = field

    def keep_cells(self, keep: Callable[[I64], Bool]) -> None:
        """Drop the cells whose keys `keep` does not select, with all that they hold."""
        for prefix, field in self.fields.items():
            self._put(prefix, field.only(np.flatnonzero(keep(field.sites.cells.keys)).astype(np.int32)))

    def begin(self, origin: I64, clock: float | None) -> None:
        """Set where the keys of a map begin, and its time, not earlier than what the map has seen."""
        for field in self.fields.values():
            field.sites.origin, field.sites.clock = origin, clock

    @property
    def origin(self) -> I64 | None:
        """The voxel (3,) where the keys of all fields begin, None as long as nothing is known."""
        return next((f.sites.origin for f in self.fields.values() if f.sites.origin is not None), None)

    def answer(self, X: NDArray[np.float64], features: NDArray[np.float32] | None) -> Prediction:
        """Answer at points (M, 3) with features (M, F), NaN where unknown, or None for all unknown.

        Raises
        ------
        InputError
            Features of another shape.
        """
        F = len(self.model.features)
        if features is None:
            features = np.full((len(X), F), np.nan, dtype=np.float32)
        if features.shape != (len(X), F):
            raise InputError(f"features must have shape ({len(X)}, {F}) for this model, not {features.shape}.")
        answers = self._field.query(X, features, self.tolerance)
        # one covariance for all classes has one variance for all of them
        variance = np.broadcast_to(answers.variance[:, None], answers.probability.shape)
        observed = answers.variance < UNEXPLAINED * self._field.prior_variance
        occupancy = None if self.occupancy is None else self.occupancy_at(X)
        return Prediction(self.classes, answers.probability, observed, variance=variance, occupancy=occupancy)

    def occupancy_at(self, X: NDArray[np.float64]) -> OccupancyPrediction:
        """Answer whether something is there, at points (M, 3).

        Raises
        ------
        InputError
            A map that keeps no free space.
        """
        if self.occupancy is None:
            raise InputError(NO_FREE_SPACE)
        return self.occupancy.answer(X, self.tolerance)

    def solve(self) -> None:
        """Solve the blocks that are not up to date, but for the tolerance."""
        for field in self.fields.values():
            field.solve(tolerance=self.tolerance)

    def crop(self, keep: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> ManyBlocks:
        """Return the same of the sites that `keep` selects."""
        mine = ManyBlocks(self.classes, self.model, self.free, self.forgetting)
        for prefix, field in self.fields.items():
            mine.fields[prefix].restore(field.sites.only(keep(field.sites.positions)))
        return mine

    @property
    def free(self) -> FreeSpace | None:
        """How free space is kept, None where it is not."""
        return None if self.occupancy is None else self.occupancy.free

    @property
    def positions(self) -> NDArray[np.float64]:
        """Sites (S, 3), metres, but for those that are forgotten."""
        sites = self._field.sites
        return sites.positions if self.forgetting is None else sites.positions[~faint(sites)]

    def __len__(self) -> int:
        """Return the number of sites."""
        return len(self._field.sites)

    @property
    def n_known(self) -> int:
        """Number of sites of labels and of free space."""
        return sum(len(field.sites) for field in self.fields.values())

    def info(self) -> dict[str, Any]:
        """Return counts and memory: the sites' own, and what solved blocks take while they are in use."""
        return {"cell_metres": CELL * self.model.resolution} | {
            prefix.replace(".", "_") + name: value
            for prefix, field in self.fields.items()
            for name, value in _counts(field).items()
        }

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return the model and the sites; posteriors follow from them."""
        settings = {"free": self.free, "forgetting": self.forgetting}
        header = {name: None if s is None else s.to_json() for name, s in settings.items()}
        arrays = {
            prefix + name: array
            for prefix, field in self.fields.items()
            for name, array in field.sites.to_arrays().items()
        }
        return {"model": self.model.to_json(), **header}, arrays

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the same again from what `to_arrays` gave.

        Raises
        ------
        InputError
            A header or arrays that do not belong together.
        """
        free, forgetting = header.get("free"), header.get("forgetting")
        made = cls(
            classes,
            BlockModel.from_json(header["model"]),
            None if free is None else FreeSpace.from_json(free),
            None if forgetting is None else Forgetting.from_json(forgetting),
        )
        for prefix, field in made.fields.items():
            field.restore(stored_sites(arrays, prefix, field.sites.mass.shape[1], field.model.n_dims))
        origins = [f.sites.origin for f in made.fields.values() if f.sites.origin is not None]
        if any((origin != origins[0]).any() for origin in origins):
            raise InputError("the stored fields of labels and of free space do not begin at one voxel: damaged.")
        return made

    @property
    def fields(self) -> dict[str, Field]:
        """The fields, by the prefix of their stored arrays."""
        return {"": self._field} | ({} if self.occupancy is None else {"free.": self.occupancy.field})


def _counts(field: Field) -> dict[str, Any]:
    sites, store = field.sites, field.store
    return {
        "sites": len(sites),
        "cells": int((sites.size > 0).sum()),
        "blocks_solved": store.n_blocks,
        "cells_to_solve": int(store.stale.sum()),
        "memory_bytes": sites.n_bytes,
        "bytes_a_site": round(sites.n_bytes / max(len(sites), 1), 1),
        "solved_bytes": store.n_bytes,
    }
