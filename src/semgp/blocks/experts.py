"""Posteriors that each block solves by itself: Dirichlet targets, and the paper's Laplace, EP and softmax.

They see the same members as the closed form, and share its blocks and blending.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from semgp.blocks.model import BlockModel
from semgp.gp.expert import fit_expert
from semgp.gp.kernels import Array
from semgp.gp.model import GPModel


class BlockExpert(Protocol):
    """The posterior of one block."""

    def predict(self, X: Array) -> tuple[Array, Array]:
        """Return probability (m, C) and latent variance (m,), a mean over classes, at inputs X (m, D)."""
        ...


def solve_expert(model: BlockModel, X: Array, mass: Array, k: Array, prior: Array) -> BlockExpert:
    """Solve a block with members X (n, D), class mass (n, C) and k (n,) sites joined in each."""
    if model.posterior == "dirichlet":
        return DirichletExpert(model, X, mass, k, prior)
    return PaperExpert(model, X, mass, prior)


class DirichletExpert:
    """Regression on the logarithms of Dirichlet variables, class by class.

    A member with mass n_c, over the number of sites that it joins, has alpha_c = n_c + a pi_c, and log-normal
    moments sigma_c^2 = log(1 + 1 / alpha_c) and y_c = log alpha_c - sigma_c^2 / 2. p_c is proportional to exp of
    the latent mean, which far from data, and for classes without mass in the block, is that of a point without
    labels. Source: Milios et al. (2018), "Dirichlet-based Gaussian Processes for Large-scale Calibrated
    Classification", eq. 6.
    """

    def __init__(self, model: BlockModel, X: Array, mass: Array, k: Array, prior: Array) -> None:
        self._kernel, self._X = model.kernel, X
        alpha = mass / k[:, None] + model.a * prior
        s2 = np.log1p(1 / alpha)
        log_prior = np.log(model.a * prior) - 0.5 * np.log1p(1 / (model.a * prior))  # of a point without labels
        Y = np.log(alpha) - s2 / 2 - log_prior
        K = model.kernel(X, X)
        self._prior, self._mean0 = prior, log_prior
        self._coefficients = np.zeros_like(Y)
        self._factors = []
        for c in np.flatnonzero(mass.sum(axis=0) > 0):
            factor = cho_factor(K + np.diag(s2[:, c] + model.nugget / k), lower=True)
            self._coefficients[:, c] = cho_solve(factor, Y[:, c])
            self._factors.append(factor)

    def predict(self, X: Array) -> tuple[Array, Array]:
        """Return probability (m, C) and latent variance (m,), a mean over classes, at inputs X (m, D)."""
        K = self._kernel(X, self._X)
        f = self._mean0 + K @ self._coefficients
        p = np.exp(f - f.max(axis=1, keepdims=True))
        reduced = [np.einsum("ij,ji->i", K, cho_solve(factor, K.T)) for factor in self._factors]
        variance = self._kernel.diag(X) - np.mean(reduced, axis=0)
        return p / p.sum(axis=1, keepdims=True), np.maximum(variance, 0)


class PaperExpert:
    """One-vs-rest Laplace or EP, or softmax Laplace, of the block's members, each with its class shares."""

    def __init__(self, model: BlockModel, X: Array, mass: Array, prior: Array) -> None:
        self._present = np.flatnonzero(mass.sum(axis=0) > 0)
        self._prior, self._n = prior, mass.sum()
        one_class = model.posterior == "softmax" and len(self._present) == 1  # whose softmax is 1 and says nothing
        inference = "laplace" if one_class else model.posterior
        gp = GPModel(kernels=(model.kernel,), inference=inference, n_inducing=None, m=(-1.0,))
        shares = mass[:, self._present] / mass.sum(axis=1, keepdims=True)
        self._expert = fit_expert(gp, self._present, X, shares)

    def predict(self, X: Array) -> tuple[Array, Array]:
        """Return probability (m, C) and latent variance (m,), a mean over classes, at inputs X (m, D)."""
        C = len(self._prior)
        absent = 1 / (self._n + C)  # Laplace's rule of succession
        probability = np.full((len(X), C), absent)
        p, _, s2 = self._expert.predict(X)
        probability[:, self._present] = p * (1 - absent * (C - len(self._present)))
        return probability, s2.mean(axis=1)
