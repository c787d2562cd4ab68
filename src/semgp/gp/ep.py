"""Expectation propagation for a binary posterior with a dense covariance.

Rasmussen & Williams 2006, algorithms 3.5, 3.6 and 5.2, with a constant prior mean. The sites are visited in
order; each sweep ends with the posterior computed afresh, so that rounding errors do not pile up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from semgp.gp.covariance import DenseCovariance, DenseFactor, Term
from semgp.gp.kernels import Array
from semgp.gp.likelihoods import Likelihood


@dataclass(frozen=True, eq=False)
class EP:
    """The Gaussian whose sites match the moments of the tilted distributions.

    Parameters
    ----------
    nlml : float
        Approximate negative log marginal likelihood, eq. 3.65.
    a : (n,) array
        (K + S^-1)^-1 (mu~ - m), S the site precisions: the posterior mean is K a + m.
    factor : DenseFactor
        K factorised together with the site precisions.
    converged : bool
        Whether a sweep changed the NLML by less than the tolerance.
    sweeps : int
        Sweeps over all sites.
    """

    nlml: float
    a: Array
    factor: DenseFactor
    converged: bool
    sweeps: int

    @property
    def term(self) -> Term[DenseFactor]:
        """Share of the gradient: at the fixed point the sites drop out (eq. 5.27)."""
        return Term(self.factor, self.a, np.zeros_like(self.a))


def expectation_propagation(
    K: DenseCovariance,
    likelihood: Likelihood,
    y: Array,
    m: float,
    tolerance: float = 1e-10,
    max_sweeps: int = 100,
) -> EP:
    """Find the fixed point of expectation propagation.

    Parameters
    ----------
    K : DenseCovariance
        Covariance of the training points.
    likelihood : Likelihood
        p(y | f); its `log_z` gives the tilted moments.
    y : (n,) array
        Labels, +1 or -1.
    m : float
        Constant prior mean.
    tolerance : float, optional
        Bound on the largest change of a site's moments in the last sweep, in posterior deviations.
    max_sweeps : int, optional
        Bound on the sweeps; the result says when it was met.
    """
    n = K.n
    nu, tau = np.zeros(n), np.zeros(n)  # natural site parameters, of f - m
    Sigma, mu = K.K.copy(), np.zeros(n)
    converged = False
    sweeps = 0
    while not converged and sweeps < max_sweeps:
        largest_change = 0.0
        for i in range(n):
            # algorithm 3.5, lines 5 and 6: the cavity
            tau_cavity = 1 / Sigma[i, i] - tau[i]
            nu_cavity = mu[i] / Sigma[i, i] - nu[i]
            new_nu, new_tau = _site(likelihood, y[i], m, nu_cavity, tau_cavity)
            change_tau, change_nu = new_tau - tau[i], new_nu - nu[i]
            change = abs(change_nu - mu[i] * change_tau) * np.sqrt(Sigma[i, i]) + abs(change_tau) * Sigma[i, i]
            largest_change = max(largest_change, change)
            nu[i], tau[i] = new_nu, new_tau
            _update_posterior(Sigma, mu, i, change_nu, change_tau)  # line 10
        factor = K.factorise(tau)
        half = factor.half_solve(K.K)  # lines 13 to 15
        Sigma = K.K - half.T @ half
        mu = Sigma @ nu
        sweeps += 1
        converged = largest_change <= tolerance
    a = nu - factor.solve(K.matvec(nu))
    nlml = 0.5 * factor.log_det_B + _nlml_of_sites(likelihood, y, m, mu, np.diag(Sigma), nu, tau)
    return EP(nlml, a, factor, converged, sweeps)


@njit(cache=True, nogil=True)
def _update_posterior(Sigma: Array, mu: Array, i: int, change_nu: float, change_tau: float) -> None:
    """Change the posterior by a change of site i: of rank one, in place."""
    s = Sigma[i].copy()
    gain = 1 / (1 + change_tau * s[i])
    step = gain * (change_nu - change_tau * mu[i])
    for j in range(len(mu)):
        mu[j] += step * s[j]
        shrink = change_tau * gain * s[j]
        for k in range(len(mu)):
            Sigma[j, k] -= shrink * s[k]


def _site(likelihood: Likelihood, y: float, m: float, nu: float, tau: float) -> tuple[float, float]:
    """Return the site parameters that match the tilted moments for a cavity (eqs. 3.58 and 3.59)."""
    mean, variance = nu / tau, 1 / tau
    _, d1, d2 = likelihood.log_z(np.array([y]), np.array([mean + m]), np.array([variance]))
    # zero where the likelihood is flat, never below: the likelihood is log-concave
    site_tau = max(-d2[0] / (1 + d2[0] * variance), 0.0)
    site_nu = (d1[0] - mean * d2[0]) / (1 + d2[0] * variance)
    return float(site_nu), float(site_tau)


def _nlml_of_sites(
    likelihood: Likelihood, y: Array, m: float, mu: Array, variance: Array, nu: Array, tau: Array
) -> float:
    """Return -log Z_EP (eq. 3.65) without log |B| / 2, arranged so that no site precision is divided by."""
    tau_c = 1 / variance - tau
    nu_c = mu / variance - nu
    mu_c = nu_c / tau_c
    log_z, _, _ = likelihood.log_z(y, mu_c + m, 1 / tau_c)
    quadratic = (tau * nu_c * mu_c - 2 * nu_c * nu - nu**2) / (tau + tau_c)
    return float(0.5 * (-np.log1p(tau / tau_c).sum() - nu @ mu - quadratic.sum()) - log_z.sum())
