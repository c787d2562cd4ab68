"""Choice of inducing points for FITC, from the training inputs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from semgp.errors import InputError
from semgp.gp.kernels import Array, checked_inputs

LLOYD_STEPS = 10
"""Steps of Lloyd's algorithm; the inducing points need to spread, not to converge."""


def random_subset(X: Array, m: int, seed: int = 0) -> Array:
    """Return m of the distinct inputs, drawn at random."""
    X = np.unique(X, axis=0)
    return np.asarray(np.random.default_rng(seed).permutation(X)[:m])


def k_means(X: Array, m: int, seed: int = 0) -> Array:
    """Return m cluster centres: dense where the inputs are dense (Lloyd's algorithm from a random subset)."""
    centres = random_subset(X, m, seed)
    for _ in range(LLOYD_STEPS):
        nearest = cKDTree(centres).query(X, workers=-1)[1]
        mass = np.bincount(nearest, minlength=len(centres))
        sums = np.column_stack([np.bincount(nearest, x, minlength=len(centres)) for x in X.T])
        taken = mass > 0
        centres[taken] = sums[taken] / mass[taken, None]
    return centres


def farthest_points(X: Array, m: int, seed: int = 0) -> Array:
    """Return m of the inputs, each as far as can be from those before it: evenly spread over the scene."""
    X = np.unique(X, axis=0)
    chosen = [int(np.random.default_rng(seed).integers(len(X)))]
    distance2 = np.full(len(X), np.inf)
    while len(chosen) < min(m, len(X)):
        distance2 = np.minimum(distance2, ((X - X[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(distance2.argmax()))
    return np.asarray(X[chosen])


INDUCING: dict[str, Callable[[Array, int, int], Array]] = {
    "random": random_subset,
    "k-means": k_means,
    "farthest": farthest_points,
}
"""The choices by name."""


def inducing_points(X: Array, m: int, method: str = "k-means", seed: int = 0) -> Array:
    """Return at most m distinct inducing points for inputs X (n, D), shape (min(m, distinct inputs), D).

    Raises
    ------
    InputError
        An unknown method, m below one, or inputs that cannot be used.
    """
    if method not in INDUCING:
        raise InputError(f"no inducing-point method is called {method!r}; choose from {', '.join(INDUCING)}.")
    if m < 1:
        raise InputError(f"at least one inducing point is needed, not {m}.")
    return INDUCING[method](checked_inputs(X), m, seed)
