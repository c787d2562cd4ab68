"""One-vs-rest classification: C binary posteriors over the same points, computed side by side.

The classes share the training points and, with shared hyperparameters, the covariance and all that follows
from it (K_uu, K_uf, V): each adds only its own Newton iterations. Classes are spread over threads.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from semgp.errors import InputError
from semgp.gp.covariance import Covariance, F, Term
from semgp.gp.kernels import Array
from semgp.gp.laplace import Laplace, gradient_in_mean, laplace, starting_point
from semgp.gp.likelihoods import Likelihood
from semgp.parallel import one_blas_thread, parallel_map


def binary_targets(weights: Array) -> Array:
    """Return targets (n, C) from class weights (n, C): 2 w - 1, +1 and -1 where a label is certain.

    Raises
    ------
    InputError
        Negative weights, or a point or class without any.
    """
    total = weights.sum(axis=1, keepdims=True)
    if (weights < 0).any() or not (total > 0).all() or not (weights.sum(axis=0) > 0).all():
        raise InputError("every training point and every class needs a positive weight: drop missing labels.")
    return np.asarray(2 * (weights / total) - 1)


def class_posteriors(
    K: Covariance[F], likelihood: Likelihood, Y: Array, m: Array, starts: Sequence[Array] | None = None
) -> list[Laplace[F]]:
    """Return Laplace's approximation for each class.

    Parameters
    ----------
    K : Covariance
        Covariance of the n training points, shared by the classes.
    likelihood : Likelihood
        p(y | f).
    Y : (n, C) array
        Targets: +1 or -1, or between for soft labels.
    m : (C,) array
        Prior mean of each class.
    starts : sequence of (n,) arrays, optional
        Where Newton's method starts for each class.
    """
    with one_blas_thread():
        points = starting_point(K, Y, m) if starts is None else starts

    def posterior(c: int) -> Laplace[F]:
        return laplace(K, likelihood, Y[:, c], m[c], points[c])

    return parallel_map(posterior, range(Y.shape[1]))


def nlml_gradient(K: Covariance[F], posteriors: Sequence[Laplace[F]]) -> tuple[Array, Array, list[Term[F]]]:
    """Return the gradient of the summed NLML in theta (P,) and in each class's mean (C,), and the terms."""
    terms = parallel_map(lambda posterior: posterior.term(K), posteriors)
    with one_blas_thread():
        return K.gradient(terms), np.array([gradient_in_mean(term) for term in terms]), terms
