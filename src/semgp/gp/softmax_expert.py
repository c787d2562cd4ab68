"""The true multi-class expert: softmax likelihood, Laplace's approximation, dense covariance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from semgp.gp.kernels import Array, Kernel
from semgp.gp.likelihoods import LIKELIHOODS
from semgp.gp.model import GPModel
from semgp.gp.probability import RULES
from semgp.gp.softmax import SoftmaxLaplace, softmax_at, softmax_laplace, softmax_latent, softmax_probability
from semgp.parallel import parallel_map, slices

BLOCK = 512
"""Query points a block."""


@dataclass(frozen=True, eq=False)
class SoftmaxExpert:
    """The posterior of P classes whose latent functions meet in one softmax.

    Parameters
    ----------
    model : GPModel
        Rule and seed. The rule "averaged" is the softmax averaged over the latent Gaussian, by sampling.
    posterior : SoftmaxLaplace
        Laplace's approximation.
    """

    model: GPModel
    posterior: SoftmaxLaplace

    @classmethod
    def fit(cls, model: GPModel, kernels: tuple[Kernel, ...], m: Array, X: Array, weights: Array) -> Self:
        """Infer the posterior from class weights (n, P) at inputs X (n, D)."""
        Y = weights / weights.sum(axis=1, keepdims=True)
        return cls(model, softmax_laplace(_one_each(kernels, len(m)), X, Y, m))

    @classmethod
    def restore(
        cls,
        model: GPModel,
        kernels: tuple[Kernel, ...],
        m: Array,
        X: Array,
        arrays: Mapping[str, Array],
        nlml: float,
        converged: bool,
    ) -> Self:
        """Make the expert again from what its `arrays` gave."""
        return cls(model, softmax_at(_one_each(kernels, len(m)), X, m, arrays["A"].T, nlml, converged))

    @property
    def nlml(self) -> float:
        """Negative log marginal likelihood."""
        return self.posterior.nlml

    @property
    def converged(self) -> bool:
        """Whether Newton's method converged."""
        return self.posterior.converged

    def predict(self, X: Array) -> tuple[Array, Array, Array]:
        """Return probability, latent mean and latent variance, each (M, P), at inputs X (M, D)."""

        def block(rows: slice) -> tuple[Array, Array, Array]:
            mean, covariance = softmax_latent(self.posterior, X[rows])
            variance = np.einsum("mcc->mc", covariance)
            if self.model.rule == "averaged":
                return softmax_probability(mean, covariance, seed=self.model.seed), mean, variance
            return RULES[self.model.rule](LIKELIHOODS[self.model.likelihood], mean, variance), mean, variance

        p, mean, variance = zip(*parallel_map(block, slices(len(X), BLOCK)), strict=True)
        return np.vstack(p), np.vstack(mean), np.vstack(variance)

    def arrays(self) -> dict[str, Array]:
        """Return A, K^-1 (f - m) of each class."""
        return {"A": np.ascontiguousarray(self.posterior.a.T)}


def _one_each(kernels: tuple[Kernel, ...], n_classes: int) -> tuple[Kernel, ...]:
    return kernels * n_classes if len(kernels) == 1 else kernels
