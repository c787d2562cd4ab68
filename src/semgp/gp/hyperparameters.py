"""Model selection: hyperparameters that minimise the negative log marginal likelihood.

Rasmussen & Williams 2006, 5.5.1. The search runs over the kernel's log-parameters and the constant means with
L-BFGS-B inside bounds; log-normal priors and restarts are optional. Nothing is changed in place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from semgp.errors import InputError
from semgp.gp.covariance import Covariance, F
from semgp.gp.kernels import Array, Kernel
from semgp.gp.likelihoods import Likelihood
from semgp.gp.one_vs_rest import class_posteriors, nlml_gradient
from semgp.parallel import one_blas_thread

Objective = Callable[[Array], tuple[float, Array]]
Progress = Callable[[int, float], None]


@dataclass(frozen=True)
class Bounds:
    """Bounds on hyperparameters, on the natural scale.

    Parameters
    ----------
    ell : (float, float)
        Length scales, in units of the inputs.
    sf : (float, float)
        Signal deviation.
    mean : (float, float)
        Constant mean of the latent function.
    """

    ell: tuple[float, float] = (1e-2, 1e2)
    sf: tuple[float, float] = (1e-1, 1e2)
    mean: tuple[float, float] = (-1e2, 1e2)

    def __post_init__(self) -> None:
        for name in ("ell", "sf"):
            low, high = getattr(self, name)
            if not 0 < low <= high:
                raise InputError(f"bounds on {name} must satisfy 0 < low <= high, not {low}, {high}.")
        if not self.mean[0] <= self.mean[1]:
            raise InputError(f"bounds on mean must satisfy low <= high, not {self.mean}.")

    def of(self, kernel: Kernel, n_means: int) -> Array:
        """Return the bounds (P + n_means, 2) of a kernel's log-parameters and of the means."""
        rows = [np.log(self.sf if name.endswith("sf") else self.ell) for name in kernel.parameter_names]
        return np.array([*rows, *([self.mean] * n_means)])


@dataclass(frozen=True)
class LogNormalPrior:
    """Independent normal priors on the logarithms of length scales and signal deviation.

    Parameters
    ----------
    ell, sf : (float, float), optional
        Median, and deviation of the logarithm. None is a flat prior.
    """

    ell: tuple[float, float] | None = None
    sf: tuple[float, float] | None = None

    def __call__(self, kernel: Kernel) -> tuple[float, Array]:
        """Return the negative log density at the parameters, less a constant, and its gradient (P,)."""
        value, gradient = 0.0, np.zeros(len(kernel.theta))
        for p, name in enumerate(kernel.parameter_names):
            prior = self.sf if name.endswith("sf") else self.ell
            if prior is not None:
                z = (kernel.theta[p] - np.log(prior[0])) / prior[1]
                value += 0.5 * z**2
                gradient[p] = z / prior[1]
        return value, gradient


@dataclass(frozen=True, eq=False)
class Learned:
    """The outcome of model selection.

    Parameters
    ----------
    kernel : Kernel
        Kernel with the best hyperparameters found.
    m : (C,) array
        Constant means.
    nlml : float
        Negative log marginal likelihood there, summed over classes, without the prior.
    gradient_norm : float
        Largest entry of the projected gradient of the objective, prior included.
    converged : bool
        Whether the search met its tolerance before its limit.
    iterations, evaluations : int
        Steps of the best run; evaluations of NLML and gradient in all runs.
    message : str
        The optimiser's last word on the best run.
    nlml_of_runs : tuple of float
        The objective reached by each run, the given start first.
    """

    kernel: Kernel
    m: Array
    nlml: float
    gradient_norm: float
    converged: bool
    iterations: int
    evaluations: int
    message: str
    nlml_of_runs: tuple[float, ...]


def learn(
    covariance: Callable[[Kernel], Covariance[F]],
    kernel: Kernel,
    likelihood: Likelihood,
    Y: Array,
    m: Array,
    bounds: Bounds | None = None,
    prior: LogNormalPrior | None = None,
    restarts: int = 0,
    seed: int = 0,
    max_iterations: int = 100,
    progress: Progress | None = None,
) -> Learned:
    """Learn one kernel for all classes, and a constant mean for each.

    Per-class hyperparameters are the same call for one column of Y at a time.

    Parameters
    ----------
    covariance : callable
        Makes the covariance of the training points from a kernel.
    kernel : Kernel
        Where the search starts.
    likelihood : Likelihood
        p(y | f).
    Y : (n, C) array
        Targets, +1 or -1.
    m : (C,) array
        Means where the search starts.
    bounds, prior : optional
        Bounds on, and priors of, the hyperparameters.
    restarts : int, optional
        Further runs from starts drawn log-uniformly from a tenth to ten times the given ones, inside the bounds.
    seed : int, optional
        Seed of those draws.
    max_iterations : int, optional
        Limit of L-BFGS-B iterations for each run.
    progress : callable, optional
        Called with the number of evaluations and the NLML after each evaluation.
    """
    n_theta = len(kernel.theta)
    limits = (bounds or Bounds()).of(kernel, Y.shape[1])
    starts: Sequence[Array] | None = None
    evaluations = 0

    def objective(parameters: Array) -> tuple[float, Array]:
        nonlocal starts, evaluations
        candidate = kernel.with_theta(parameters[:n_theta])
        K = covariance(candidate)
        posteriors = class_posteriors(K, likelihood, Y, parameters[n_theta:], starts)
        d_theta, d_m, _ = nlml_gradient(K, posteriors)
        starts = [posterior.a for posterior in posteriors]
        evaluations += 1
        nlml = sum(posterior.nlml for posterior in posteriors)
        if progress is not None:
            progress(evaluations, nlml)
        penalty, d_penalty = prior(candidate) if prior else (0.0, np.zeros(n_theta))
        return nlml + penalty, np.concatenate([d_theta + d_penalty, d_m])

    rng = np.random.default_rng(seed)
    first = np.concatenate([kernel.theta, m])
    draws = [first + np.append(rng.uniform(-1, 1, n_theta) * np.log(10), 0 * m) for _ in range(restarts)]
    runs = []
    for start in (first, *draws):
        starts = None
        with one_blas_thread():
            runs.append(_search(objective, np.clip(start, *limits.T), limits, max_iterations))
    best = min(runs, key=lambda run: float(run.fun))
    chosen = kernel.with_theta(best.x[:n_theta])
    nlml = float(best.fun) - (prior(chosen)[0] if prior else 0.0)
    projected = np.clip(best.x - best.jac, limits[:, 0], limits[:, 1]) - best.x
    return Learned(
        kernel=chosen,
        m=best.x[n_theta:],
        nlml=nlml,
        gradient_norm=float(np.abs(projected).max()),
        converged=bool(best.success),
        iterations=int(best.nit),
        evaluations=evaluations,
        message=str(best.message),
        nlml_of_runs=tuple(float(run.fun) for run in runs),
    )


def _search(objective: Objective, start: Array, limits: Array, max_iterations: int) -> OptimizeResult:
    """Minimise by L-BFGS-B; the result's `fun` and `jac` are the objective's own."""
    # Inside bounds its first step is the whole gradient, orders of magnitude in a hyperparameter: scale that to
    # one e-fold.
    scale = 1 / max(1.0, float(np.linalg.norm(objective(start)[1])))

    def scaled(parameters: Array) -> tuple[float, Array]:
        value, gradient = objective(parameters)
        return scale * value, scale * gradient

    options = {"maxiter": max_iterations, "maxfun": 4 * max_iterations}
    run = minimize(scaled, start, jac=True, method="L-BFGS-B", bounds=limits, options=options)
    run.fun, run.jac = run.fun / scale, run.jac / scale
    return run
