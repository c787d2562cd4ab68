"""Counting labels per voxel: the semantic counting sensor model, without rays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.baselines.voxels import VoxelMass
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.maps.protocol import query_points, training_part
from semgp.maps.settings import require_data, require_positive, require_prior, stored_setting
from semgp.prediction import Prediction
from semgp.upward import Up


class CSMMap:
    """Class probabilities as shares of the labels that fell into a voxel.

    A point in a voxel without labels is not observed and gets the uniform distribution. Free space is not
    counted: the classes are those of the labels.

    Parameters
    ----------
    classes : Classes
        The classes of the map.
    resolution : float, optional
        Edge of a voxel in metres.
    alpha0 : float, optional
        Prior count of each class. At 0, the default, probabilities are bare shares, and a class not seen in a
        voxel has probability zero there; Gan et al. take 0.001.

    Raises
    ------
    InputError
        A resolution that is not positive, or a negative prior.

    Notes
    -----
    Source: the S-CSM of Gan, Zhang, Grizzle, Eustice and Ghaffari Jadidi (2020), "Bayesian Spatial Kernel
    Smoothing for Scalable Dense Semantic Mapping".
    """

    kind = "csm"
    up: Up = "z"

    def __init__(self, classes: Classes, resolution: float = 0.02, alpha0: float = 0.0) -> None:
        self.classes = classes
        self.resolution = require_positive("resolution", resolution)
        self.alpha0 = require_prior(alpha0)
        self._voxels = VoxelMass(len(classes), self.resolution)

    def update(self, cloud: LabelledCloud) -> None:
        """Count the labels of a cloud, hard or soft.

        Raises
        ------
        InputError
            Other classes than the map's, or points a million voxels away from the first.
        """
        part = training_part(cloud, self.classes)
        self._voxels.add(self._voxels.keys(part.points), part.class_weights)

    def query(self, points: ArrayLike) -> Prediction:
        """Answer at points (M, 3) with the shares of their voxels.

        Raises
        ------
        InputError
            Points that are not (M, 3) and finite, or a map without labelled points.
        """
        X = query_points(points)
        require_data(len(self))
        count = self._voxels.at(X)
        observed = count.max(axis=1) > 0
        count += np.float32(self.alpha0)
        count[~observed] = 1
        return Prediction(self.classes, count / count.sum(axis=1, keepdims=True), observed)

    @property
    def positions(self) -> NDArray[np.float64]:
        """Centres (V, 3) of the voxels, metres."""
        return self._voxels.centres

    def __len__(self) -> int:
        """Return the number of voxels that hold labels."""
        return len(self._voxels)

    def info(self) -> dict[str, Any]:
        """Return settings, counts and memory figures."""
        return {
            "kind": self.kind,
            **self._settings(),
            "voxels": len(self),
            "memory_bytes": self._voxels.n_bytes,
        }

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return a header and arrays from which `from_arrays` makes the same map."""
        return dict(self._settings()), self._voxels.to_arrays()

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the map again from what `to_arrays` gave.

        Raises
        ------
        InputError
            Entries that are missing or damaged.
        """
        made = cls(classes, *(stored_setting(header, name) for name in ("resolution", "alpha0")))
        made._voxels = VoxelMass.from_arrays(len(classes), made.resolution, arrays)
        return made

    def _settings(self) -> dict[str, float]:
        return {"resolution": self.resolution, "alpha0": self.alpha0}
