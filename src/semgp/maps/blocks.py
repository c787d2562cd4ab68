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

    Raises
    ------
    InputError
        A model for another number of classes.
    """

    def __init__(self, classes: Classes, model: BlockModel) -> None:
        self.classes, self.model = classes, model
        self.tolerance = 0.0
        self._field = Field(model, len(classes))

    def add(self, cloud: LabelledCloud) -> None:
        """Add the labelled points of a cloud.

        Raises
        ------
        InputError
            Features that are missing, or points a million voxels from the first.
        """
        add_cloud(self._field, cloud)

    def answer(self, X: NDArray[np.float64], features: NDArray[np.float32] | None) -> Prediction:
        """Answer at points (M, 3) with features (M, F), NaN where unknown, or None for all unknown.

        Raises
        ------
        InputError
            Features of another shape, or a map without labels.
        """
        require_data(len(self))
        F = len(self.model.features)
        if features is None:
            features = np.full((len(X), F), np.nan, dtype=np.float32)
        if features.shape != (len(X), F):
            raise InputError(f"features must have shape ({len(X)}, {F}) for this model, not {features.shape}.")
        answers = self._field.query(X, features, self.tolerance)
        # one covariance for all classes has one variance for all of them
        variance = np.broadcast_to(answers.variance[:, None], answers.probability.shape)
        observed = answers.variance < UNEXPLAINED * self._field.prior_variance
        return Prediction(self.classes, answers.probability, observed, variance=variance)

    def solve(self) -> None:
        """Solve the blocks that are not up to date, but for the tolerance."""
        self._field.solve(tolerance=self.tolerance)

    def crop(self, keep: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> ManyBlocks:
        """Return the same of the sites that `keep` selects."""
        mine, sites = ManyBlocks(self.classes, self.model), self._field.sites
        chosen = keep(sites.positions)
        arrays = sites.to_arrays()
        arrays |= {name: arrays[name][chosen] for name in ("voxels", "mass", "place")}
        mine._restore(arrays)
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
        sites, store = self._field.sites, self._field.store
        return {
            "sites": len(sites),
            "cells": int((sites.size > 0).sum()),
            "cell_metres": CELL * self.model.resolution,
            "blocks_solved": store.n_blocks,
            "cells_to_solve": int(store.stale.sum()),
            "memory_bytes": sites.n_bytes,
            "bytes_a_site": round(sites.n_bytes / max(len(sites), 1), 1),
            "solved_bytes": store.n_bytes,
        }

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return the model and the sites; posteriors follow from them."""
        return {"model": self.model.to_json()}, self._field.sites.to_arrays()

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the same again from what `to_arrays` gave.

        Raises
        ------
        InputError
            A header or arrays that do not belong together.
        """
        made = cls(classes, BlockModel.from_json(header["model"]))
        D, C = made.model.n_dims, len(classes)
        voxels = stored_array(arrays, "voxels", np.int64, (None,))
        made._restore({
            "voxels": voxels,
            "mass": stored_array(arrays, "mass", np.uint32, (len(voxels), C + made.model.other)),
            "place": stored_array(arrays, "place", np.int64, (len(voxels), D)),
            "origin": stored_array(arrays, "origin", np.int64, (3,)),
        })  # fmt: skip
        return made

    def _restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        self._field.sites.restore(arrays)
        self._field.touch(np.arange(len(self._field.sites.cells), dtype=np.int32))
