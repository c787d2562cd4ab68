"""The map for real work: every label of every scan, in many blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semgp.blocks.field import Field
from semgp.blocks.inputs import add_cloud
from semgp.blocks.model import BlockModel
from semgp.blocks.sites import CELL
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.free_space import FreeSpace
from semgp.maps.occupancy import Occupancy
from semgp.maps.settings import require_data, stored_array
from semgp.prediction import Prediction

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

    Raises
    ------
    InputError
        A model for another number of classes, or settings of free space that do not go with it.
    """

    def __init__(self, classes: Classes, model: BlockModel, free: FreeSpace | None = None) -> None:
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
        rays = None if self.occupancy is None else self.occupancy.sample(cloud)
        add_cloud(self._field, cloud)
        if self.occupancy is not None and rays is not None:
            self.occupancy.add(rays)

    def answer(self, X: NDArray[np.float64], features: NDArray[np.float32] | None) -> Prediction:
        """Answer at points (M, 3) with features (M, F), NaN where unknown, or None for all unknown.

        Raises
        ------
        InputError
            Features of another shape, or a map without labels.
        """
        require_data(sum(len(field.sites) for field in self._fields.values()))
        F = len(self.model.features)
        if features is None:
            features = np.full((len(X), F), np.nan, dtype=np.float32)
        if features.shape != (len(X), F):
            raise InputError(f"features must have shape ({len(X)}, {F}) for this model, not {features.shape}.")
        answers = self._field.query(X, features, self.tolerance)
        # one covariance for all classes has one variance for all of them
        variance = np.broadcast_to(answers.variance[:, None], answers.probability.shape)
        observed = answers.variance < UNEXPLAINED * self._field.prior_variance
        occupancy = None if self.occupancy is None else self.occupancy.answer(X, self.tolerance)
        return Prediction(self.classes, answers.probability, observed, variance=variance, occupancy=occupancy)

    def solve(self) -> None:
        """Solve the blocks that are not up to date, but for the tolerance."""
        for field in self._fields.values():
            field.solve(tolerance=self.tolerance)

    def crop(self, keep: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> ManyBlocks:
        """Return the same of the sites that `keep` selects."""
        mine = ManyBlocks(self.classes, self.model, None if self.occupancy is None else self.occupancy.free)
        for name, field in self._fields.items():
            chosen = keep(field.sites.positions)
            arrays = field.sites.to_arrays()
            mine._fields[name].restore(
                arrays | {part: arrays[part][chosen] for part in ("voxels", "mass", "place")}
            )
        return mine

    @property
    def positions(self) -> NDArray[np.float64]:
        """Sites (S, 3), metres."""
        return self._field.sites.positions

    def __len__(self) -> int:
        """Return the number of sites."""
        return len(self._field.sites)

    def info(self) -> dict[str, Any]:
        """Return counts and memory: the sites' own, and what solved blocks take while they are in use."""
        fields = {"": self._field} if self.occupancy is None else {"": self._field, "free_": self.occupancy.field}
        return {"cell_metres": CELL * self.model.resolution} | {
            prefix + name: value for prefix, field in fields.items() for name, value in _counts(field).items()
        }

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return the model and the sites; posteriors follow from them."""
        free = None if self.occupancy is None else self.occupancy.free.to_json()
        arrays = {
            prefix + name: array
            for prefix, field in self._fields.items()
            for name, array in field.sites.to_arrays().items()
        }
        return {"model": self.model.to_json(), "free": free}, arrays

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the same again from what `to_arrays` gave.

        Raises
        ------
        InputError
            A header or arrays that do not belong together.
        """
        free = header.get("free")
        made = cls(
            classes, BlockModel.from_json(header["model"]), None if free is None else FreeSpace.from_json(free)
        )
        for prefix, field in made._fields.items():
            columns = field.sites.mass.shape[1]
            voxels = stored_array(arrays, prefix + "voxels", np.int64, (None,))
            field.restore({
                "voxels": voxels,
                "mass": stored_array(arrays, prefix + "mass", np.uint32, (len(voxels), columns)),
                "place": stored_array(arrays, prefix + "place", np.int64, (len(voxels), field.model.n_dims)),
                "origin": stored_array(arrays, prefix + "origin", np.int64, (3,)),
            })  # fmt: skip
        return made

    @property
    def _fields(self) -> dict[str, Field]:
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
