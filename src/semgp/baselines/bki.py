"""Semantic Bayesian kernel inference (S-BKI): label counts smoothed by a sparse kernel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.baselines.smoothing import spread
from semgp.baselines.voxels import VoxelMass
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.protocol import query_points, training_part
from semgp.maps.settings import require_data, require_positive, stored_setting
from semgp.parallel import parallel_map, slices
from semgp.prediction import Prediction
from semgp.upward import Up

_MOST_VOXELS = 32  # the number of voxels that a label reaches grows with the cube of this
_CHUNK = 16_384  # points that one thread smooths at a time, neighbours in space


class BKIMap:
    """Each voxel holds a Dirichlet distribution over classes that all labels within `ell` have added to.

    With voxel centre x, labels y_i at x_i and the sparse kernel k, the concentration of class c is
    alpha_c = alpha0 + sum_i k(|x - x_i|) y_ic. The probability is alpha_c / sum alpha, and `mean` and
    `variance` are those of the Dirichlet distribution. A query is answered by the voxel that it lies in;
    where no label is within `ell` of that voxel's centre, the point is not observed and the uniform prior
    stands.

    This is the method as published but for free space: no points are sampled along the rays, as the classes
    are those of the labels. The defaults are the settings that its authors publish with their code.

    Parameters
    ----------
    classes : Classes
        The classes of the map.
    resolution : float, optional
        Edge of a voxel in metres.
    ell : float, optional
        Radius of the kernel in metres.
    sigma0 : float, optional
        Value of the kernel at distance zero: the weight of a label against the prior.
    alpha0 : float, optional
        Prior concentration of each class.

    Raises
    ------
    InputError
        A setting that is not positive, or `ell` beyond 32 voxels.

    Notes
    -----
    Source: Gan, Zhang, Grizzle, Eustice and Ghaffari Jadidi (2020), "Bayesian Spatial Kernel Smoothing for
    Scalable Dense Semantic Mapping".
    """

    kind = "bki"
    up: Up = "z"

    def __init__(
        self,
        classes: Classes,
        resolution: float = 0.1,
        ell: float = 0.3,
        sigma0: float = 10.0,
        alpha0: float = 0.001,
    ) -> None:
        self.classes = classes
        self.resolution = require_positive("resolution", resolution)
        self.ell = require_positive("ell", ell)
        self.sigma0 = require_positive("sigma0", sigma0)
        self.alpha0 = require_positive("alpha0", alpha0)
        if ell > _MOST_VOXELS * resolution:
            raise InputError(
                f"ell = {ell} m is more than {_MOST_VOXELS} voxels of {resolution} m: take larger voxels."
            )
        self._voxels = VoxelMass(len(classes), self.resolution)

    def update(self, cloud: LabelledCloud) -> None:
        """Add the labels of a cloud, hard or soft, to the voxels around them.

        Raises
        ------
        InputError
            Other classes than the map's, or points a million voxels away from the first.
        """
        part = training_part(cloud, self.classes)
        keys = self._voxels.keys(part.points)
        order = np.argsort(keys)
        keys, mass = keys[order], part.class_weights[order]
        voxel_units = part.points[order] / self.resolution
        fraction = voxel_units - np.floor(voxel_units)

        def smooth(s: slice) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
            return spread(keys[s], fraction[s], mass[s], self.ell / self.resolution, self.sigma0)

        for around in parallel_map(smooth, slices(len(keys), _CHUNK)):
            self._voxels.add(*around)

    def query(self, points: ArrayLike) -> Prediction:
        """Answer at points (M, 3) with the Dirichlet distributions of their voxels.

        Raises
        ------
        InputError
            Points that are not (M, 3) and finite, or a map without labelled points.
        """
        X = query_points(points)
        require_data(len(self))
        alpha = self._voxels.at(X)
        observed = alpha.max(axis=1) > 0
        alpha += np.float32(self.alpha0)
        total = alpha.sum(axis=1, keepdims=True)
        mean = alpha / total
        variance = mean * (1 - mean) / (total + 1)
        return Prediction(self.classes, mean, observed, mean=mean, variance=variance)

    @property
    def positions(self) -> NDArray[np.float64]:
        """Centres (V, 3) of the voxels, metres."""
        return self._voxels.centres

    def __len__(self) -> int:
        """Return the number of voxels that a label has reached."""
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
        settings = (stored_setting(header, name) for name in ("resolution", "ell", "sigma0", "alpha0"))
        made = cls(classes, *settings)
        made._voxels = VoxelMass.from_arrays(len(classes), made.resolution, arrays)
        return made

    def _settings(self) -> dict[str, float]:
        return {
            "resolution": self.resolution,
            "ell": self.ell,
            "sigma0": self.sigma0,
            "alpha0": self.alpha0,
        }
