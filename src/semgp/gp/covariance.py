"""The covariance of the training points: dense or not, Laplace is written once and never knows which.

A covariance K is factorised together with the curvatures W of the likelihood. Everything that inference,
learning and prediction need follows from R = (K + W^-1)^-1 = W^1/2 B^-1 W^1/2 with B = I + W^1/2 K W^1/2
(Rasmussen & Williams, 3.4.3), which stays well conditioned where W is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from scipy.linalg import solve_triangular

from semgp.gp.kernels import Array, Kernel, checked_inputs


class Factor(Protocol):
    """K factorised together with the curvatures W."""

    @property
    def log_det_B(self) -> float:
        """log |I + W^1/2 K W^1/2|."""
        ...

    def solve(self, v: Array) -> Array:
        """Return R v for v (n,)."""
        ...

    def marginal_variance(self) -> Array:
        """Return the diagonal (n,) of (K^-1 + W)^-1, the posterior covariance at the training points."""
        ...


F = TypeVar("F", bound=Factor)


class Term(NamedTuple, Generic[F]):
    """One posterior's share of the gradient: d NLML = tr(G dK) with G = (R - a a' + u a' + a u') / 2.

    `a` is K^-1 (f - m); `u` carries the dependence of the mode on K (Rasmussen & Williams, 5.5.1).
    """

    factor: F
    a: Array
    u: Array


class Predictor(Protocol):
    """Latent mean and variance of C posteriors at any point."""

    def __call__(self, X: Array) -> tuple[Array, Array]:
        """Return mean, prior mean excluded, and variance, both (M, C), at inputs X (M, D)."""
        ...


class Covariance(Protocol[F]):
    """The covariance K (n, n) of the latent function at n training points."""

    n: int

    def matvec(self, v: Array) -> Array:
        """Return K v for v (n,)."""
        ...

    def factorise(self, W: Array, rough: bool = False) -> F:
        """Factorise K together with curvatures W (n,), W >= 0.

        `rough` allows single precision: enough for Newton steps, whose errors the next step mends.
        """
        ...

    def gradient(self, terms: Sequence[Term[F]]) -> Array:
        """Return the sum over the terms of tr(G dK / dtheta), shape (P,)."""
        ...

    def predictor(self, terms: Sequence[Term[F]]) -> Predictor:
        """Return what predicts for the posteriors of the terms, all of them at once."""
        ...


class DenseCovariance:
    """The exact covariance matrix.

    Parameters
    ----------
    kernel : Kernel
        Covariance function.
    X : (n, D) array
        Training inputs.
    """

    def __init__(self, kernel: Kernel, X: Array) -> None:
        self.kernel = kernel
        self.X = checked_inputs(X)
        self.n = len(self.X)
        self.K = kernel(self.X, self.X)

    def matvec(self, v: Array) -> Array:
        """Return K v for v (n,)."""
        return self.K @ v

    def factorise(self, W: Array, rough: bool = False) -> DenseFactor:
        """Factorise K together with curvatures W (n,), always in double precision."""
        root_W: Array = np.sqrt(W)
        B = root_W[:, None] * self.K * root_W
        B[np.diag_indices(self.n)] += 1
        return DenseFactor(self.K, root_W, np.asarray(np.linalg.cholesky(B), dtype=np.float64))

    def gradient(self, terms: Sequence[Term[DenseFactor]]) -> Array:
        """Return the sum over the terms of tr(G dK / dtheta), shape (P,)."""
        A = np.column_stack([term.a for term in terms])
        U = np.column_stack([term.u for term in terms])
        G = (U - A / 2) @ A.T
        for term in terms:
            G += term.factor.R() / 2
        return self.kernel.contract(self.X, self.X, G)

    def predictor(self, terms: Sequence[Term[DenseFactor]]) -> DensePredictor:
        """Return what predicts for the posteriors of the terms."""
        A = np.column_stack([term.a for term in terms])
        roots = np.stack([solve_triangular(t.factor.L, np.diag(t.factor.root_W), lower=True) for t in terms])
        return DensePredictor(self.kernel, self.X, A, roots)


@dataclass(frozen=True, eq=False)
class DenseFactor:
    """L L' = B = I + W^1/2 K W^1/2."""

    K: Array
    root_W: Array
    L: Array

    @property
    def log_det_B(self) -> float:
        """log |B|."""
        return float(2 * np.log(np.diag(self.L)).sum())

    def half_solve(self, v: Array) -> Array:
        """Return L^-1 W^1/2 v, the square root of v' R v."""
        return np.asarray(solve_triangular(self.L, (self.root_W * v.T).T, lower=True, check_finite=False))

    def solve(self, v: Array) -> Array:
        """Return R v for v (n,) or (n, k)."""
        half = solve_triangular(self.L, self.half_solve(v), lower=True, trans=1, check_finite=False)
        return np.asarray((self.root_W * half.T).T)

    def R(self) -> Array:
        """Return R (n, n)."""
        root = solve_triangular(self.L, np.diag(self.root_W), lower=True, check_finite=False)
        return np.asarray(root.T @ root)

    def marginal_variance(self) -> Array:
        """Return the diagonal (n,) of K - K R K."""
        return np.asarray(np.diag(self.K) - (self.half_solve(self.K) ** 2).sum(axis=0))


@dataclass(frozen=True, eq=False)
class DensePredictor:
    """Predicts from all training points (Rasmussen & Williams, algorithm 3.2).

    Parameters
    ----------
    kernel : Kernel
        Covariance function.
    X : (n, D) array
        Training inputs.
    A : (n, C) array
        K^-1 (f - m) of each posterior.
    roots : (C, n, n) array
        L^-1 W^1/2 of each posterior, a square root of R.
    """

    kernel: Kernel
    X: Array
    A: Array
    roots: Array

    def __call__(self, X: Array) -> tuple[Array, Array]:
        """Return mean, prior mean excluded, and variance, both (M, C), at inputs X (M, D)."""
        K = self.kernel(X, self.X)
        prior = self.kernel.diag(X)
        variance = [prior - np.einsum("mi,mi->m", half, half) for half in (K @ root.T for root in self.roots)]
        return K @ self.A, np.column_stack(variance)
