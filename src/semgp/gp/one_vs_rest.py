"""One-vs-rest classification: C binary posteriors over the same points, computed side by side.

The classes share the training points and, with shared hyperparameters, the covariance and all that follows
from it (K_uu, K_uf, V): each adds only its own Newton iterations. Classes are spread over threads.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.errors import InputError
from semgp.gp.covariance import Covariance, F, Term
from semgp.gp.kernels import Array
from semgp.gp.laplace import Laplace, gradient_in_mean, laplace, starting_point
from semgp.gp.likelihoods import Likelihood
from semgp.parallel import parallel_map


def binary_targets(labels: ArrayLike, classes: ArrayLike) -> Array:
    """Return targets (n, C): +1 where the label is the class of the column, -1 elsewhere.

    Raises
    ------
    InputError
        A class without a single label, or a label that is none of the classes.
    """
    labels, classes = np.asarray(labels), np.asarray(classes)
    is_class = labels[:, None] == classes
    if not is_class.any(axis=1).all():
        raise InputError("some labels are none of the classes: drop missing labels before training.")
    if not is_class.any(axis=0).all():
        raise InputError("some classes have no training point: leave them out.")
    return np.where(is_class, 1.0, -1.0)


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
        Targets, +1 or -1.
    m : (C,) array
        Prior mean of each class.
    starts : sequence of (n,) arrays, optional
        Where Newton's method starts for each class.
    """
    points = starting_point(K, Y, m) if starts is None else starts

    def posterior(c: int) -> Laplace[F]:
        return laplace(K, likelihood, Y[:, c], m[c], points[c])

    return parallel_map(posterior, range(Y.shape[1]))


def nlml_gradient(K: Covariance[F], posteriors: Sequence[Laplace[F]]) -> tuple[Array, Array, list[Term[F]]]:
    """Return the gradient of the summed NLML in theta (P,) and in each class's mean (C,), and the terms."""
    terms = parallel_map(lambda posterior: posterior.term(K), posteriors)
    return K.gradient(terms), np.array([gradient_in_mean(term) for term in terms]), terms


def normalise(scores: Array) -> NDArray[np.float64]:
    """Return class scores (M, C), non-negative, over their sum; uniform where all of them are zero."""
    total = scores.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(scores, total, out=np.full_like(scores, 1 / scores.shape[1]), where=total > 0))
