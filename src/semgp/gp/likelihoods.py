"""Likelihoods of a binary label y = +1 or -1 given the latent value f, and their averages over a Gaussian.

Each gives log p(y | f) and its first three derivatives in f (Rasmussen & Williams, 3.4 and table 3.1), without
loss of digits for |f| up to 1e3 and beyond.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from scipy.special import expit, log_ndtr, ndtr

from semgp.gp.kernels import Array
from semgp.gp.likelihood_derivatives import logistic_derivatives, probit_derivatives


class Derivatives(NamedTuple):
    """log p(y | f) and its derivatives in f, each of shape (n,)."""

    log_p: Array
    d1: Array
    d2: Array
    d3: Array


class Likelihood(Protocol):
    """p(y | f), log-concave in f, for targets y of +1 and -1; one between is a soft label."""

    name: str

    def derivatives(self, y: Array, f: Array) -> Derivatives:
        """Return log p(y | f) and its first three derivatives in f; y and f of shape (n,)."""
        ...

    def sigmoid(self, f: Array) -> Array:
        """Return p(y = +1 | f)."""
        ...

    def averaged(self, mean: Array, variance: Array) -> Array:
        """Return the integral of p(y = +1 | f) N(f | mean, variance) df, for arrays of one shape."""
        ...

    def log_z(self, y: Array, mean: Array, variance: Array) -> tuple[Array, Array, Array]:
        """Return log Z, Z the average of p(y | f), and its first two derivatives in the mean."""
        ...


class Probit:
    """The error-function likelihood of the paper: p(y | f) = Phi(y f)."""

    name = "probit"

    def derivatives(self, y: Array, f: Array) -> Derivatives:
        """Return log p(y | f) and its first three derivatives in f; y and f of shape (n,)."""
        return Derivatives(*probit_derivatives(y, f))

    def sigmoid(self, f: Array) -> Array:
        """Return Phi(f)."""
        return np.asarray(ndtr(f))

    def averaged(self, mean: Array, variance: Array) -> Array:
        """Return Phi(mean / sqrt(1 + variance)) (Rasmussen & Williams, eq. 3.25)."""
        return np.asarray(ndtr(mean / np.sqrt(1 + variance)))

    def log_z(self, y: Array, mean: Array, variance: Array) -> tuple[Array, Array, Array]:
        """Return log Z and its first two derivatives in the mean (Rasmussen & Williams, 3.9)."""
        scale = np.sqrt(1 + variance)
        log_p, d1, d2, _ = probit_derivatives(y, mean / scale)
        return log_p, d1 / scale, d2 / scale**2


class Logistic:
    """The logistic likelihood: p(y | f) = 1 / (1 + exp(-y f))."""

    name = "logistic"

    def derivatives(self, y: Array, f: Array) -> Derivatives:
        """Return log p(y | f) and its first three derivatives in f; y and f of shape (n,)."""
        return Derivatives(*logistic_derivatives(y, f))

    def sigmoid(self, f: Array) -> Array:
        """Return 1 / (1 + exp(-f))."""
        return np.asarray(expit(f))

    def averaged(self, mean: Array, variance: Array) -> Array:
        """Return the average of the logistic function over a Gaussian, by quadrature to 1e-12.

        The trapezoidal rule converges geometrically for analytic functions. Below a deviation of 1 it runs over
        the Gaussian; above, over the logistic density, since the average is also E[Phi((mean - e) / deviation)]
        for logistic noise e.
        """
        mean, deviation = np.broadcast_arrays(mean, np.sqrt(variance))
        p = np.empty(mean.shape)
        narrow = deviation < 1
        z = np.arange(-9, 9.01, 0.5)
        w = 0.5 * np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
        p[narrow] = expit(mean[narrow, None] + deviation[narrow, None] * z) @ w
        e = np.arange(-40, 40.01, 0.5)
        w = 0.5 * expit(e) * expit(-e)
        p[~narrow] = ndtr((mean[~narrow, None] - e) / deviation[~narrow, None]) @ w
        return p

    def log_z(self, y: Array, mean: Array, variance: Array) -> tuple[Array, Array, Array]:
        """Return log Z and its first two derivatives in the mean, by the quadratures of `averaged`."""
        mean, deviation = np.broadcast_arrays(np.asarray(y * mean, dtype=np.float64), np.sqrt(variance))
        e = np.arange(-40, 40.01, 0.5)
        z = np.arange(-9, 9.01, 0.5)
        narrow = (deviation < 1)[..., None]
        # log of weight times integrand, and the first two log-derivatives of the integrand, on either rule
        f = mean[..., None] + deviation[..., None] * z
        log_narrow = np.log(0.5 / np.sqrt(2 * np.pi)) - z**2 / 2 - np.logaddexp(0, -f)
        u = (mean[..., None] - e) / np.where(narrow, 1, deviation[..., None])
        log_wide = np.log(0.5) - np.logaddexp(0, e) - np.logaddexp(0, -e) + log_ndtr(u)
        log_z, d1, d2 = _log_moments(log_narrow, expit(-f), expit(-f) * (expit(-f) - expit(f)))
        ratio = np.exp(-(u**2) / 2 - log_ndtr(u)) / np.sqrt(2 * np.pi)
        s = np.where(narrow[..., 0], 1, deviation)[..., None]
        wide = _log_moments(log_wide, ratio / s, -u * ratio / s**2)
        narrow = narrow[..., 0]
        pick = [np.where(narrow, a, b) for a, b in zip((log_z, d1, d2), wide, strict=True)]
        return pick[0], y * pick[1], pick[2]


def _log_moments(log_terms: Array, first: Array, second: Array) -> tuple[Array, Array, Array]:
    """Return log sum, and the first two derivatives of it, for terms with f'/f = first, f''/f = second."""
    top = log_terms.max(axis=-1, keepdims=True)
    w = np.exp(log_terms - top)
    total = w.sum(axis=-1)
    d1 = (w * first).sum(axis=-1) / total
    return top[..., 0] + np.log(total), d1, (w * second).sum(axis=-1) / total - d1**2


LIKELIHOODS: dict[str, Likelihood] = {"probit": Probit(), "logistic": Logistic()}
"""The likelihoods by name."""
