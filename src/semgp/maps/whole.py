"""The paper's map: one expert for the whole scan."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.expert import Expert, fit_expert, restore_expert
from semgp.gp.model import GPModel
from semgp.maps.training import TrainingSet, training_set
from semgp.prediction import Prediction

UNEXPLAINED = 0.95
"""A point whose latent variance is above this share of the prior's, for every class, counts as not observed."""


class WholeScan:
    """All labelled points as one training set, its posterior computed when first asked for.

    Parameters
    ----------
    classes : Classes
        The map's classes. One that no training point has costs nothing; its probability is that of one
        observation among all, 1 / (n + C).
    model : GPModel
        Kernel, likelihood, inference.

    Raises
    ------
    InputError
        A model for another number of classes.
    """

    def __init__(self, classes: Classes, model: GPModel) -> None:
        model.fits(len(classes))
        self.classes = classes
        self.model = model
        self._points = np.empty((0, 3))
        self._weights = np.empty((0, len(classes)), dtype=np.float32)
        self._training: TrainingSet | None = None
        self._expert: Expert | None = None

    def add(self, cloud: LabelledCloud) -> None:
        """Add the labelled points of a cloud."""
        keep = cloud.labelled
        self._add(cloud.points[keep], cloud.class_weights[keep])

    def _add(self, points: NDArray[np.float64], weights: NDArray[np.float32]) -> None:
        self._points = np.concatenate([self._points, points])
        self._weights = np.concatenate([self._weights, weights])
        self._training = self._expert = None

    def answer(self, X: NDArray[np.float64], features: NDArray[np.float32] | None) -> Prediction:
        """Answer at points (M, 3).

        Raises
        ------
        InputError
            Features, which this model does not have, or no labelled point yet.
        """
        if features is not None:
            raise InputError("a whole-scan model takes no features: leave them out, or use a block model.")
        training, expert = self._posterior()
        p, f, s2 = expert.predict(X - training.origin)
        M, C = len(X), len(self.classes)
        # Laplace's rule of succession for the classes that were never seen
        unseen = 1 / (len(training.X) + C)
        probability, mean, variance = np.full((M, C), unseen), np.zeros((M, C)), np.zeros((M, C))
        probability[:, training.present] = p * (1 - unseen * (C - len(training.present)))
        prior = np.array([self.model.kernel(c).diag(training.X[:1])[0] for c in range(C)])
        mean += [self.model.mean(c) for c in range(C)]
        variance += prior
        mean[:, training.present], variance[:, training.present] = f, s2
        observed = np.asarray((variance < UNEXPLAINED * prior).any(axis=1))
        return Prediction(self.classes, probability, observed, mean, variance)

    def solve(self) -> None:
        """Compute the posterior now, if it is not up to date."""
        self._posterior()

    def crop(self, keep: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> WholeScan:
        """Return the same of the points that `keep` selects."""
        mine, chosen = WholeScan(self.classes, self.model), keep(self._points)
        mine._add(self._points[chosen], self._weights[chosen])
        return mine

    def _posterior(self) -> tuple[TrainingSet, Expert]:
        if self._training is None or self._expert is None:
            training = training_set(self.model, self._points, self._weights)
            self._expert = fit_expert(self.model, training.present, training.X, training.weights)
            self._training = training
        return self._training, self._expert

    @property
    def positions(self) -> NDArray[np.float64]:
        """Labelled points (N, 3), metres."""
        return self._points

    def __len__(self) -> int:
        return len(self._points)

    @property
    def n_known(self) -> int:
        """Number of points."""
        return len(self)

    def info(self) -> dict[str, Any]:
        """Return counts, convergence and memory."""
        names = self.classes.names
        known: dict[str, Any] = {"labelled_points": len(self)}
        if self._training is not None and self._expert is not None:
            known["training_points"] = len(self._training.X)
            known["classes_present"] = [names[c] for c in self._training.present]
            known["nlml"], known["converged"] = self._expert.nlml, self._expert.converged
        known["memory_bytes"] = self._points.nbytes + self._weights.nbytes
        return known

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return a header ready for JSON and plain arrays from which `from_arrays` makes the same map."""
        header: dict[str, Any] = {"model": self.model.to_json(), "solved": self._expert is not None}
        arrays: dict[str, NDArray[Any]] = {"points": self._points, "weights": self._weights}
        if self._expert is not None:
            header |= {"nlml": self._expert.nlml, "converged": self._expert.converged}
            arrays |= {f"expert.{name}": value for name, value in self._expert.arrays().items()}
        return header, arrays

    @classmethod
    def from_arrays(cls, classes: Classes, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the map again from what `to_arrays` gave.

        Raises
        ------
        InputError
            A header or arrays that do not belong together.
        """
        gp_map = cls(classes, GPModel.from_json(header["model"]))
        gp_map.add(LabelledCloud(arrays["points"], classes, weights=arrays["weights"]))
        if header["solved"]:
            training = training_set(gp_map.model, gp_map._points, gp_map._weights)
            expert = {name.removeprefix("expert."): a for name, a in arrays.items() if name.startswith("expert.")}
            if expert["A"].shape != (len(training.X), len(training.present)):
                raise InputError("the posterior does not fit the training points.")
            gp_map._training = training
            gp_map._expert = restore_expert(
                gp_map.model, training.present, training.X, expert, header["nlml"], header["converged"]
            )
        return gp_map
