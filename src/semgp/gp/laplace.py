"""Laplace's approximation of a binary posterior: Newton's method to the mode, evidence and its gradient.

Rasmussen & Williams 2006, algorithms 3.1 and 5.1, for any covariance structure and log-concave likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic

import numpy as np

from semgp.gp.covariance import Covariance, F, Term
from semgp.gp.kernels import Array
from semgp.gp.likelihoods import Derivatives, Likelihood
from semgp.gp.line_search import line_search

ROUGH_STEPS, NEAR = 20, 1e-3
"""Single precision serves for so many steps, unless progress ends once the squared decrement is this small."""


@dataclass(frozen=True, eq=False)
class Laplace(Generic[F]):
    """The Gaussian at the mode of p(f | y).

    Parameters
    ----------
    nlml : float
        Approximate negative log marginal likelihood, eq. 3.32.
    a : (n,) array
        K^-1 (f - m) at the mode.
    factor : Factor
        K factorised together with the curvatures at the mode.
    likelihood_at_mode : Derivatives
        log p(y | f) and its derivatives.
    converged : bool
        Whether the Newton decrement fell below the tolerance.
    iterations : int
        Newton steps taken.
    """

    nlml: float
    a: Array
    factor: F
    likelihood_at_mode: Derivatives
    converged: bool
    iterations: int

    def term(self, K: Covariance[F]) -> Term[F]:
        """Return this posterior's share of the gradient in the covariance (algorithm 5.1, lines 7 to 15)."""
        s = -0.5 * self.factor.marginal_variance() * self.likelihood_at_mode.d3
        return Term(self.factor, self.a, s - self.factor.solve(K.matvec(s)))


def gradient_in_mean(term: Term[F]) -> float:
    """Return d NLML / d m for a constant prior mean m."""
    return float(term.u.sum() - term.a.sum())


def laplace(
    K: Covariance[F],
    likelihood: Likelihood,
    y: Array,
    m: float,
    a: Array | None = None,
    tolerance: float = 1e-9,
    max_iterations: int = 100,
) -> Laplace[F]:
    """Find the mode of p(f | y) and Laplace's approximation there.

    Parameters
    ----------
    K : Covariance
        Covariance of the training points.
    likelihood : Likelihood
        p(y | f).
    y : (n,) array
        Targets: +1 or -1, or between for soft labels.
    m : float
        Constant prior mean.
    a : (n,) array, optional
        Where to start, for example the mode for other hyperparameters.
    tolerance : float, optional
        Bound on the squared Newton decrement, in nats; one more step follows it.
    max_iterations : int, optional
        Bound on the Newton steps; the result says when it was met.
    """
    a = starting_point(K, y[:, None], np.array([m]))[0] if a is None else a
    Ka = K.matvec(a)
    d = likelihood.derivatives(y, Ka + m)
    rough, decrement, converged, iterations = True, np.inf, False, 0
    while not converged and iterations < max_iterations:
        # algorithm 3.1, lines 4 to 6, in terms of the residual, so that rounding errors cannot pile up
        residual = d.d1 - a
        step = residual - K.factorise(-d.d2, rough).solve(K.matvec(residual))
        K_step = K.matvec(step)
        last, decrement = decrement, float(K_step @ residual)
        if rough and (decrement < 0 or iterations == ROUGH_STEPS or 0.1 * last < decrement < NEAR):
            rough = False  # single precision is at its end
            continue
        converged = decrement <= tolerance
        length, d = _along(likelihood, y, Ka + m, K_step, d, float(step @ Ka), float(step @ K_step))
        a = a + length * step
        Ka = Ka + length * K_step
        iterations += 1
    # once more from `a` alone, so that a stored mode gives the same posterior to the last bit
    Ka = K.matvec(a)
    d = likelihood.derivatives(y, Ka + m)
    factor = K.factorise(-d.d2)
    nlml = 0.5 * float(a @ Ka) - float(d.log_p.sum()) + 0.5 * factor.log_det_B
    return Laplace(nlml, a, factor, d, converged, iterations)


def starting_point(K: Covariance[F], Y: Array, m: Array) -> list[Array]:
    """Return (K + I)^-1 (4 y - m), a coarse regression on the labels, for targets (n, C) and means (C,).

    It starts Newton's method near |f| = 4, where zero, the usual start, needs several steps more.
    """
    unit = K.factorise(np.ones(K.n))
    return [unit.solve(4 * Y[:, c] - m[c]) for c in range(Y.shape[1])]


def _along(
    likelihood: Likelihood, y: Array, f: Array, K_step: Array, d: Derivatives, sKa: float, sKs: float
) -> tuple[float, Derivatives]:
    """Minimise psi along a step; return its length and the derivatives of the likelihood there.

    psi(t) = (a + t s)' K (a + t s) / 2 - sum log p(y | f + t K s).
    """

    def at(t: float) -> tuple[float, float, Derivatives]:
        d = likelihood.derivatives(y, f + t * K_step)
        return sKa + t * sKs - float(d.d1 @ K_step), sKs - float(d.d2 @ K_step**2), d

    return line_search(sKa - float(d.d1 @ K_step), at)
