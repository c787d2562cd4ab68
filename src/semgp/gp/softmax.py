"""True multi-class classification: the softmax likelihood with Laplace's approximation, dense covariance.

Rasmussen & Williams 2006, 3.5, algorithms 3.3 and 3.4; the gradient of the evidence carries their 5.5.1 over to
C classes. Arrays hold one row a class: f, pi and y are (C, n).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.special import log_softmax, softmax

from semgp.gp.kernels import Array, Kernel, checked_inputs
from semgp.gp.line_search import line_search
from semgp.parallel import parallel_map


@dataclass(frozen=True, eq=False)
class SoftmaxLaplace:
    """The Gaussian at the mode of p(f | y), f the latent functions of all classes.

    Parameters
    ----------
    kernels : tuple of Kernel
        One covariance function a class.
    X : (n, D) array
        Training inputs.
    m : (C,) array
        Constant prior means.
    nlml : float
        Approximate negative log marginal likelihood, eq. 3.44.
    a : (C, n) array
        K^-1 (f - m) at the mode.
    pi : (C, n) array
        Class probabilities at the mode.
    E : (C, n, n) array
        D^1/2 (I + D^1/2 K D^1/2)^-1 D^1/2 for each class, D = diag(pi).
    L : (n, n) array
        Cholesky factor of the sum of E over the classes.
    converged : bool
        Whether the Newton decrement fell below the tolerance.
    iterations : int
        Newton steps taken.
    """

    kernels: tuple[Kernel, ...]
    X: Array
    m: Array
    nlml: float
    a: Array
    pi: Array
    E: Array
    L: Array
    converged: bool
    iterations: int


def softmax_laplace(
    kernels: Sequence[Kernel],
    X: Array,
    Y: Array,
    m: Array,
    tolerance: float = 1e-9,
    max_iterations: int = 100,
) -> SoftmaxLaplace:
    """Find the mode of p(f | y) and Laplace's approximation there (algorithm 3.3).

    Parameters
    ----------
    kernels : sequence of Kernel
        One covariance function a class.
    X : (n, D) array
        Training inputs.
    Y : (n, C) array
        Targets: one in the column of the label, zero elsewhere.
    m : (C,) array
        Constant prior means.
    tolerance : float, optional
        Bound on the squared Newton decrement, in nats; one more step follows it.
    max_iterations : int, optional
        Bound on the Newton steps; the result says when it was met.
    """
    X = checked_inputs(X)
    K = np.stack([kernel(X, X) for kernel in kernels])
    y, m = np.ascontiguousarray(Y.T, dtype=np.float64), np.asarray(m, dtype=np.float64)
    a = np.zeros_like(y)
    f = a + m[:, None]
    converged = False
    iterations = 0
    while not converged and iterations < max_iterations:
        pi = softmax(f, axis=0)
        E, L, _ = _factorise(K, pi)
        residual = y - pi - a
        step = residual - _solve(E, L, _apply(K, residual))
        K_step = _apply(K, step)
        decrement = float(np.vdot(K_step, residual))
        converged = decrement <= tolerance
        length = _along(y, f, f - m[:, None], step, K_step)
        a = a + length * step
        f = f + length * K_step
        iterations += 1
    f = _apply(K, a) + m[:, None]
    E, L, log_det = _factorise(K, softmax(f, axis=0))
    nlml = 0.5 * np.vdot(a, f - m[:, None]) - np.vdot(y, log_softmax(f, axis=0)) + 0.5 * log_det
    return SoftmaxLaplace(tuple(kernels), X, m, float(nlml), a, softmax(f, axis=0), E, L, converged, iterations)


def softmax_at(
    kernels: Sequence[Kernel], X: Array, m: Array, a: Array, nlml: float, converged: bool
) -> SoftmaxLaplace:
    """Return the posterior again from a mode `a` (C, n) found before."""
    K = np.stack([kernel(X, X) for kernel in kernels])
    pi = softmax(_apply(K, a) + m[:, None], axis=0)
    E, L, _ = _factorise(K, pi)
    return SoftmaxLaplace(tuple(kernels), X, m, nlml, a, pi, E, L, converged, 0)


def _apply(K: Array, v: Array) -> Array:
    """Return K v for block-diagonal K (C, n, n) and v (C, n)."""
    return np.asarray(np.matvec(K, v))


def _factorise(K: Array, pi: Array) -> tuple[Array, Array, float]:
    """Return E, the Cholesky factor of its sum over classes, and log |I + W^1/2 K W^1/2| (lines 4 to 7)."""

    def one_class(c: int) -> tuple[Array, float]:
        root = np.sqrt(pi[c])
        L = cholesky(np.eye(len(root)) + root[:, None] * K[c] * root, lower=True, check_finite=False)
        half = solve_triangular(L, np.diag(root), lower=True, check_finite=False)
        return half.T @ half, float(2 * np.log(np.diag(L)).sum())

    parts = parallel_map(one_class, range(len(K)))
    E = np.stack([part[0] for part in parts])
    L = cholesky(E.sum(axis=0), lower=True, check_finite=False)
    return E, L, sum(part[1] for part in parts) + float(2 * np.log(np.diag(L)).sum())


def _solve(E: Array, L: Array, v: Array) -> Array:
    """Return (K + W^-1)^-1 v = E v - E R (R' E R)^-1 R' E v, R the stacked identities (eq. 3.47)."""
    Ev = _apply(E, v)
    return np.asarray(Ev - E @ cho_solve((L, True), Ev.sum(axis=0), check_finite=False))


def _along(y: Array, f: Array, Ka: Array, step: Array, K_step: Array) -> float:
    """Minimise psi(t) = (a + t s)' K (a + t s) / 2 - sum log p(y | f + t K s) along a step; return its length."""
    sKa, sKs = float(np.vdot(step, Ka)), float(np.vdot(step, K_step))

    def at(t: float) -> tuple[float, float, None]:
        pi = softmax(f + t * K_step, axis=0)
        mean = (pi * K_step).sum(axis=0)
        curvature = sKs + float(np.vdot(pi, (K_step - mean) ** 2))
        return sKa + t * sKs - float(np.vdot(y - pi, K_step)), curvature, None

    return line_search(sKa - float(np.vdot(y - softmax(f, axis=0), K_step)), at)[0]


def softmax_gradient(posterior: SoftmaxLaplace) -> tuple[list[Array], Array]:
    """Return d NLML / d theta, a vector (P,) for each class's kernel, and d NLML / d m (C,).

    d NLML = sum_c tr(G_c dK_c) with G = (R - a a' + u a' + a u') / 2, R = (K + W^-1)^-1; u carries the
    dependence of the mode on K: u = (I + W K)^-1 s, s = d(log |B| / 2) / df.
    """
    p = posterior
    C = len(p.kernels)
    K = np.stack([kernel(p.X, p.X) for kernel in p.kernels])
    # R_c = E_c - H_c' H_c, and H_c K_c = L^-1 E_c K_c gives the posterior covariance of two classes at a point
    H = np.stack(parallel_map(lambda c: solve_triangular(p.L, p.E[c], lower=True, check_finite=False), range(C)))
    HK = H @ K
    cross = np.einsum("cin,din->cdn", HK, HK)
    for c in range(C):
        cross[c, c] += np.diag(K[c]) - np.einsum("in,in->n", K[c], p.E[c] @ K[c])
    diagonal = np.einsum("ccn->cn", cross)
    q = diagonal - 2 * np.einsum("cdn,dn->cn", cross, p.pi)
    s = 0.5 * p.pi * (q - (p.pi * q).sum(axis=0))
    u = s - _solve(p.E, p.L, _apply(K, s))
    gradients = []
    for c, kernel in enumerate(p.kernels):
        G = (p.E[c] - H[c].T @ H[c]) / 2 + np.outer(u[c] - p.a[c] / 2, p.a[c])
        gradients.append(kernel.contract(p.X, p.X, G))
    return gradients, np.asarray(u.sum(axis=1) - p.a.sum(axis=1))


def softmax_latent(posterior: SoftmaxLaplace, X: Array) -> tuple[Array, Array]:
    """Return the latent mean (M, C) and covariance (M, C, C) at inputs X (M, D) (algorithm 3.4, lines 3 to 10)."""
    p = posterior
    k = np.stack([kernel(X, p.X) for kernel in p.kernels])
    mean = np.einsum("cmn,cn->mc", k, p.a) + p.m
    Ek = k @ p.E
    half = np.stack([solve_triangular(p.L, b.T, lower=True, check_finite=False) for b in Ek])
    covariance = np.einsum("cim,dim->mcd", half, half)
    for c, kernel in enumerate(p.kernels):
        covariance[:, c, c] += kernel.diag(X) - np.einsum("mn,mn->m", k[c], Ek[c])
    return mean, covariance


def softmax_probability(mean: Array, covariance: Array, samples: int = 1000, seed: int = 0) -> Array:
    """Return the softmax averaged over the latent Gaussian, (M, C), by seeded sampling (lines 11 to 16)."""
    root = np.linalg.cholesky(covariance + 1e-12 * np.eye(mean.shape[1]))
    z = np.random.default_rng(seed).standard_normal((samples // 2, mean.shape[1]))
    total = np.zeros_like(mean)
    for draw in np.vstack([z, -z]):  # antithetic pairs: the mean of the draws is exact
        total += softmax(mean + root @ draw, axis=1)
    return total / (2 * len(z))
