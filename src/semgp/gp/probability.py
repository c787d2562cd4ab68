"""From latent functions to class probabilities: three rules, and why the paper's is not the default.

averaged
    The paper's rule: the likelihood averaged over each latent Gaussian, then divided by the sum over classes.
    After training, signal deviations are large; away from the data of a class its average then drifts to 1/2,
    and the C - 1 other classes together outvote the right one: far under-confident.
plug-in
    The likelihood at the latent means, divided by the sum over classes.
softmax
    The softmax of the latent means: the default, since it measures best (see docs/design.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import softmax

from semgp.gp.kernels import Array
from semgp.gp.likelihoods import Likelihood
from semgp.parallel import parallel_map, slices

BLOCK = 8192
"""Points a block."""


def averaged(likelihood: Likelihood, mean: Array, variance: Array) -> Array:
    """Return averaged likelihoods over their sum, (M, C); uniform where all of them underflow to zero."""
    p = likelihood.averaged(mean, variance)
    total = p.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(p, total, out=np.full_like(p, 1 / p.shape[1]), where=total > 0))


def plug_in(likelihood: Likelihood, mean: Array, variance: Array) -> Array:
    """Return likelihoods at the means over their sum, (M, C), in logarithms so that none underflows."""
    f = np.ascontiguousarray(mean).ravel()
    log_p = likelihood.derivatives(np.ones_like(f), f).log_p.reshape(mean.shape)
    return np.asarray(softmax(log_p, axis=1))


def softmax_of_means(likelihood: Likelihood, mean: Array, variance: Array) -> Array:
    """Return the softmax of the means, (M, C)."""
    return np.asarray(softmax(mean, axis=1))


def class_probability(rule: str, likelihood: Likelihood, mean: Array, variance: Array) -> Array:
    """Return class probabilities (M, C) by the rule of that name, block by block on all cores."""
    probability = np.empty_like(mean)

    def fill(rows: slice) -> None:
        probability[rows] = RULES[rule](likelihood, mean[rows], variance[rows])

    parallel_map(fill, slices(len(mean), BLOCK))
    return probability


RULES: dict[str, Callable[[Likelihood, Array, Array], Array]] = {
    "softmax": softmax_of_means,
    "plug-in": plug_in,
    "averaged": averaged,
}
"""The rules by name."""
