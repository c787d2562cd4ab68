"""A committee of maps: the answers of maps that cannot be joined, combined point by point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from semgp.checks import rigid_transform
from semgp.classes import Classes
from semgp.errors import InputError
from semgp.maps.gp import GPSemanticMap
from semgp.maps.pooling import Array, Weights, common_classes, fuse_predictions, require_weights
from semgp.maps.protocol import SemanticMap, query_points
from semgp.prediction import Prediction

_FAR = 1e5  # metres from all data: there a map answers with its prior


class Committee:
    """Maps of one place that answer as one: a Bayesian committee machine (Tresp, 2000).

    For maps whose observations cannot be added up: other models, the paper's map, voxel maps. Maps of one
    `BlockModel` are better fused, see `semgp.maps.fusion`. How answers are combined: `fuse_predictions`.

    Parameters
    ----------
    maps : sequence of SemanticMap
        Maps of the same classes, each with labels; they are asked for their priors now.
    T_world_map : sequence of (4, 4) arrays, optional
        For each map the rigid transform from its frame to that of the queries. Left out, all frames are one.
    weights : "robust" or "one", optional
        See `fuse_predictions`.

    Raises
    ------
    InputError
        No map, classes that differ, a map without labels, transforms that are none or not one a map, or other
        weights.
    """

    def __init__(
        self,
        maps: Sequence[SemanticMap],
        T_world_map: Sequence[ArrayLike] | None = None,
        *,
        weights: Weights = "robust",
    ) -> None:
        require_weights(weights)
        self.maps, self.weights = tuple(maps), weights
        self.classes = common_classes(self.maps)
        if T_world_map is not None and len(T_world_map) != len(self.maps):
            raise InputError(f"{len(self.maps)} maps need as many transforms, not {len(T_world_map)}.")
        self._to_map = [
            np.linalg.inv(rigid_transform(f"T_world_map[{k}]", T)) for k, T in enumerate(T_world_map or ())
        ]
        self._prior, self._prior_variance, self._prior_occupancy = _priors(self.maps, self.classes)

    def query(self, points: ArrayLike) -> Prediction:
        """Return the maps' answers at points (M, 3), metres, as one.

        There is a variance where all maps are Gaussian processes of one prior variance, an occupancy where all
        keep free space, and no mean.

        Raises
        ------
        InputError
            Points that cannot be used.
        """
        X = query_points(points)
        places = [X @ T[:3, :3].T + T[:3, 3] for T in self._to_map] or [X] * len(self.maps)
        return fuse_predictions(
            [m.query(place) for m, place in zip(self.maps, places)],
            prior=self._prior,
            prior_variance=self._prior_variance,
            prior_occupancy=self._prior_occupancy,
            weights=self.weights,
        )


def _priors(maps: Sequence[SemanticMap], classes: Classes) -> tuple[Array, Array | None, float]:
    """What maps answer far from all data: mean probabilities (C,), variances (K, C), mean occupancy."""
    far = [m.query(m.positions.max(axis=0, initial=0.0)[None] + _FAR) for m in maps]
    # a map that has observed every place, such as the nearest neighbours', has no prior
    prior = [np.full(len(classes), 1 / len(classes)) if p.observed[0] else p.probability[0] for p in far]
    occupancy = [0.5 if p.occupancy is None else p.occupancy.probability[0] for p in far]
    variances = [p.variance[0] for p in far if p.variance is not None]
    latent = len(variances) == len(maps) and all(isinstance(m, GPSemanticMap) for m in maps)
    return np.mean(prior, axis=0), np.stack(variances) if latent else None, float(np.mean(occupancy))
