"""Experts: the posterior of the classes present among one set of training points.

An expert keeps the few numbers that inference found. Factors and predictors follow from them, to the last bit
the same after saving and loading.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from semgp.gp.covariance import Covariance, DenseCovariance, Predictor, Term
from semgp.gp.ep import expectation_propagation
from semgp.gp.fitc import FITCCovariance
from semgp.gp.inducing import inducing_points
from semgp.gp.kernels import Array, Kernel, checked_inputs
from semgp.gp.likelihoods import LIKELIHOODS
from semgp.gp.model import GPModel
from semgp.gp.one_vs_rest import binary_targets, class_posteriors
from semgp.gp.probability import class_probability
from semgp.gp.softmax_expert import SoftmaxExpert
from semgp.parallel import one_blas_thread, parallel_map


class Expert(Protocol):
    """The posterior of P classes over one set of training points."""

    @property
    def nlml(self) -> float:
        """Negative log marginal likelihood."""
        ...

    @property
    def converged(self) -> bool:
        """Whether inference converged for every class."""
        ...

    def predict(self, X: Array) -> tuple[Array, Array, Array]:
        """Return probability, latent mean and latent variance, each (M, P), at inputs X (M, D)."""
        ...

    def arrays(self) -> dict[str, Array]:
        """Return what inference found, from which `restore` makes the same expert."""
        ...


@dataclass(frozen=True, eq=False)
class OneVsRest:
    """Binary posteriors side by side, one class against the others (the paper's).

    Parameters
    ----------
    model : GPModel
        Likelihood, inference and rule.
    kernels : tuple of Kernel
        One shared by the classes, or one a class.
    m : (P,) array
        Constant means.
    X : (n, D) array
        Training inputs.
    U : (n_inducing, D) array or None
        Inducing inputs; None for the dense covariance.
    A, W : (n, P) array
        K^-1 (f - m), and the curvature or site precision, of each class.
    nlml : float
        Negative log marginal likelihood, summed over the classes.
    converged : bool
        Whether inference converged for every class.
    """

    model: GPModel
    kernels: tuple[Kernel, ...]
    m: Array
    X: Array
    U: Array | None
    A: Array
    W: Array
    nlml: float
    converged: bool

    @classmethod
    def fit(cls, model: GPModel, kernels: tuple[Kernel, ...], m: Array, X: Array, weights: Array) -> Self:
        """Infer the posterior from class weights (n, P) at inputs X (n, D)."""
        Y = binary_targets(weights)
        U = None if model.n_inducing is None else inducing_points(X, model.n_inducing, model.inducing, model.seed)
        shared = len(kernels) == 1
        found: list[tuple[Array, Array, float, bool]] = []
        for g, kernel in enumerate(kernels):
            columns = slice(None) if shared else slice(g, g + 1)
            found += _posteriors(model, covariance(kernel, X, U), Y[:, columns], m[columns])
        A, W, nlml, converged = zip(*found, strict=True)
        return cls(model, kernels, m, X, U, np.column_stack(A), np.column_stack(W), sum(nlml), all(converged))

    def predict(self, X: Array) -> tuple[Array, Array, Array]:
        """Return probability, latent mean and latent variance, each (M, P), at inputs X (M, D)."""
        parts = [predictor(X) for predictor in self._predictors]
        mean, variance = parts[0] if len(parts) == 1 else map(np.hstack, zip(*parts, strict=True))
        mean += self.m
        p = class_probability(self.model.rule, LIKELIHOODS[self.model.likelihood], mean, variance)
        return p, mean, variance

    @cached_property
    def _predictors(self) -> list[Predictor]:
        shared = len(self.kernels) == 1
        groups = [range(self.A.shape[1])] if shared else [range(p, p + 1) for p in range(self.A.shape[1])]
        with one_blas_thread():
            return [
                _predictor(covariance(kernel, self.X, self.U), self.A[:, group], self.W[:, group])
                for kernel, group in zip(self.kernels, groups, strict=True)
            ]

    def arrays(self) -> dict[str, Array]:
        """Return inducing points, A and W."""
        return {"A": self.A, "W": self.W} | ({} if self.U is None else {"U": self.U})


def covariance(kernel: Kernel, X: Array, U: Array | None) -> Covariance[Any]:
    """Return the dense covariance, or FITC where there are inducing points."""
    return DenseCovariance(kernel, X) if U is None else FITCCovariance(kernel, X, U)


def _posteriors(model: GPModel, K: Covariance[Any], Y: Array, m: Array) -> list[tuple[Array, Array, float, bool]]:
    """Return a, W, NLML and convergence for each class."""
    likelihood = LIKELIHOODS[model.likelihood]
    if isinstance(K, DenseCovariance) and model.inference == "ep":
        sites = [expectation_propagation(K, likelihood, Y[:, c], m[c]) for c in range(Y.shape[1])]
        return [(ep.a, ep.factor.root_W**2, ep.nlml, ep.converged) for ep in sites]
    modes = class_posteriors(K, likelihood, Y, m)
    return [(mode.a, -mode.likelihood_at_mode.d2, mode.nlml, mode.converged) for mode in modes]


def _predictor(K: Covariance[Any], A: Array, W: Array) -> Predictor:
    """Return the predictor of posteriors given by a and W, one a column."""
    factors = parallel_map(lambda c: K.factorise(W[:, c]), range(W.shape[1]))
    return K.predictor([Term(factor, A[:, c], np.zeros_like(A[:, c])) for c, factor in enumerate(factors)])


def fit_expert(model: GPModel, present: NDArray[np.int64], X: Array, weights: Array) -> Expert:
    """Infer the posterior of the classes `present` (P,) from their weights (n, P) at inputs X (n, D)."""
    kernels, m = _of_present(model, present)
    expert = SoftmaxExpert if model.inference == "softmax" else OneVsRest
    with one_blas_thread():
        return expert.fit(model, kernels, m, checked_inputs(X), weights)


def restore_expert(
    model: GPModel, present: NDArray[np.int64], X: Array, arrays: Mapping[str, Array], nlml: float, converged: bool
) -> Expert:
    """Make an expert again from its training inputs and what its `arrays` gave."""
    kernels, m = _of_present(model, present)
    if model.inference == "softmax":
        return SoftmaxExpert.restore(model, kernels, m, X, arrays, nlml, converged)
    return OneVsRest(model, kernels, m, X, arrays.get("U"), arrays["A"], arrays["W"], nlml, converged)


def _of_present(model: GPModel, present: NDArray[np.int64]) -> tuple[tuple[Kernel, ...], Array]:
    """Return the kernels, one shared or one a class, and the means of the classes present."""
    shared = len(model.kernels) == 1
    kernels = model.kernels if shared else tuple(model.kernel(c) for c in present)
    return kernels, np.array([model.mean(c) for c in present])
