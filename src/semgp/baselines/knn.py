"""k nearest neighbours: a vote of the labelled points closest to the query, weighted by distance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.protocol import query_points, training_part
from semgp.maps.settings import require_data, require_positive, require_prior, stored_array, stored_setting
from semgp.parallel import parallel_map, slices
from semgp.prediction import Prediction
from semgp.upward import Up

_SETTINGS = ("k", "width", "kernel", "max_distance", "alpha0")
_CHUNK = 4_096  # query points that one thread answers at a time

Kernel = Literal["exp", "gauss"]


class KNNMap:
    """Class probabilities as the weighted vote of the k nearest labelled points.

    Parameters
    ----------
    classes : Classes
        The classes of the map.
    k : int, optional
        Number of neighbours that vote; fewer where there are fewer.
    width : float, optional
        Width of the weight in metres.
    kernel : {"exp", "gauss"}, optional
        A neighbour at distance d votes with exp(-d / width) or exp(-d^2 / (2 width^2)).
    max_distance : float, optional
        Neighbours farther away, in metres, do not vote, and a point without any is not observed. Left out,
        every point is answered by its nearest neighbours, however far.
    alpha0 : float, optional
        Prior vote for each class, where the nearest neighbour's vote counts 1. At 0, the default, a class
        without a neighbour has probability zero.

    Raises
    ------
    InputError
        A setting that is not positive, a negative prior, or an unknown kernel.

    Notes
    -----
    The plain rival of every continuous map; distance-weighted votes are those of Dudani (1976), "The
    Distance-Weighted k-Nearest-Neighbor Rule". Weights are taken relative to the nearest neighbour's, which
    the normalisation cancels, so that the vote stays defined arbitrarily far from the data.
    """

    kind = "knn"
    up: Up = "z"

    def __init__(
        self,
        classes: Classes,
        k: int = 8,
        width: float = 0.02,
        kernel: Kernel = "exp",
        max_distance: float | None = None,
        alpha0: float = 0.0,
    ) -> None:
        if not isinstance(k, (int, np.integer)) or k < 1:
            raise InputError(f"k must be a whole number of neighbours, at least 1, not {k!r}.")
        if kernel not in ("exp", "gauss"):
            raise InputError(f"the kernel must be 'exp' or 'gauss', not {kernel!r}.")
        self.classes = classes
        self.k = int(k)
        self.width = require_positive("width", width)
        self.kernel = kernel
        self.max_distance = None if max_distance is None else require_positive("max_distance", max_distance)
        self.alpha0 = require_prior(alpha0)
        self._points = np.zeros((0, 3))
        # Hard labels are rows of the identity and share them; each soft label brings a row of its own.
        self._votes = np.eye(len(classes), dtype=np.float32)
        self._vote_of = np.zeros(0, dtype=np.int32)
        self._tree: cKDTree | None = None  # of all points, once a query has asked for it

    def update(self, cloud: LabelledCloud) -> None:
        """Store the labelled points of a cloud, labels hard or soft.

        Raises
        ------
        InputError
            Other classes than the map's.
        """
        part = training_part(cloud, self.classes)
        if part.weights is None:
            rows = part.hard_labels
        else:
            rows = len(self._votes) + np.arange(len(part), dtype=np.int32)
            self._votes = np.concatenate([self._votes, part.weights])
        self._points = np.concatenate([self._points, part.points])
        self._vote_of = np.concatenate([self._vote_of, rows])
        self._tree = None

    def query(self, points: ArrayLike) -> Prediction:
        """Answer at points (M, 3). The first query after an update builds the search tree.

        Raises
        ------
        InputError
            Points that are not (M, 3) and finite, or a map without labelled points.
        """
        X = query_points(points)
        require_data(len(self))
        if self._tree is None:
            self._tree = cKDTree(self._points, balanced_tree=False)
        tree = self._tree
        probability = np.empty((len(X), len(self.classes)), dtype=np.float32)
        observed = np.empty(len(X), dtype=bool)

        def answer(s: slice) -> None:
            probability[s], observed[s] = self._vote(tree, X[s])

        parallel_map(answer, slices(len(X), _CHUNK))
        return Prediction(self.classes, probability, observed)

    def _vote(self, tree: cKDTree, X: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        ranks = np.arange(1, min(self.k, len(self)) + 1)
        limit = np.inf if self.max_distance is None else self.max_distance
        distance, neighbour = tree.query(X, k=ranks, distance_upper_bound=limit)
        found = np.isfinite(distance)
        nearest = np.where(found[:, :1], distance[:, :1], 0)
        if self.kernel == "exp":
            exponent = (nearest - distance) / self.width
        else:
            exponent = (nearest - distance) * (nearest + distance) / (2 * self.width**2)
        weight = np.exp(exponent).astype(np.float32)  # zero for neighbours not found, at distance infinity
        vote = self._vote_of[np.where(found, neighbour, 0)]
        votes = np.full((len(X), len(self.classes)), self.alpha0, dtype=np.float32)
        _tally(votes, weight, vote, self._votes)
        observed = found[:, 0]
        votes[~observed] = 1
        return votes / votes.sum(axis=1, keepdims=True), observed

    @property
    def positions(self) -> NDArray[np.float64]:
        """Stored points (N, 3), metres."""
        return self._points

    def __len__(self) -> int:
        """Return the number of stored points."""
        return len(self._points)

    def info(self) -> dict[str, Any]:
        """Return settings, counts and memory figures."""
        arrays = (self._points, self._votes, self._vote_of)
        return {
            "kind": self.kind,
            **self._settings(),
            "points": len(self),
            "memory_bytes": sum(a.nbytes for a in arrays),
        }

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return a header and arrays from which `from_arrays` makes the same map."""
        arrays: dict[str, NDArray[Any]] = {"points": self._points, "votes": self._votes, "vote_of": self._vote_of}
        return self._settings(), arrays

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the map again from what `to_arrays` gave.

        Raises
        ------
        InputError
            Entries that are missing or damaged.
        """
        made = cls(
            classes,
            *(stored_setting(header, name) for name in _SETTINGS),
        )
        made._points = query_points(stored_array(arrays, "points", np.float64, (None, 3)))
        made._votes = stored_array(arrays, "votes", np.float32, (None, len(classes)))
        made._vote_of = stored_array(arrays, "vote_of", np.int32, (len(made._points),))
        rows = made._vote_of
        if not (np.isfinite(made._votes) & (made._votes >= 0)).all():
            raise InputError("the stored map is damaged: votes must be finite and not negative.")
        if len(rows) and (rows.min() < 0 or rows.max() >= len(made._votes)):
            raise InputError("the stored map is damaged: a point names a vote that is not there.")
        return made

    def _settings(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in _SETTINGS}


@njit(cache=True, nogil=True)
def _tally(
    total: NDArray[np.float32],
    weight: NDArray[np.float32],
    vote: NDArray[np.int32],
    votes: NDArray[np.float32],
) -> None:
    """Add to each query's total the votes of its neighbours."""
    for i in range(len(total)):
        for j in range(vote.shape[1]):
            for c in range(total.shape[1]):
                total[i, c] += weight[i, j] * votes[vote[i, j], c]
