"""Pooled answers against closed forms, and weights against naive loops."""

import math
from typing import cast

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.gp.kernels import Kernel
from semgp.gp.stationary import Matern52
from semgp.maps.pooling import fuse_predictions
from semgp.prediction import OccupancyPrediction, Prediction
from tests.maps.pooling.answers import prediction

Array = NDArray[np.float64]


class TestClosedForms:
    def test_two_gaussian_posteriors_of_independent_data(self) -> None:
        """Observations of one latent value with noise s: precisions 1 / v_0 + n / s."""
        v_0, s, n = 0.7, 0.3, (3, 11)
        halves = [prediction([0.5, 0.5], variance=1 / (1 / v_0 + k / s)) for k in n]
        fused = fuse_predictions(halves, prior_variance=v_0, weights="one")
        np.testing.assert_allclose(cast("Array", fused.variance), 1 / (1 / v_0 + sum(n) / s))

    def test_two_gaussian_processes_far_apart(self) -> None:
        """Data beyond each other's reach: the BCM is the posterior of both."""
        kernel: Kernel = Matern52((1.0,), 0.8)
        rng = np.random.default_rng(0)
        X = [rng.uniform(0, 2, (5, 3)), rng.uniform(0, 2, (5, 3)) + 200]
        queries = np.vstack([x + 0.3 for x in X])

        def variance(data: Array) -> Array:
            K, k = kernel(data, data) + 0.1 * np.eye(len(data)), kernel(queries, data)
            explained: Array = 0.64 - (k * np.linalg.solve(K, k.T).T).sum(axis=1)
            return explained[:, None]

        halves = [prediction(np.full((10, 1), 1.0), variance=variance(x)) for x in X]
        fused = fuse_predictions(halves, prior_variance=0.64, weights="one")
        np.testing.assert_allclose(cast("Array", fused.variance), variance(np.vstack(X)), rtol=1e-9)

    def test_likelihoods_over_one_prior(self) -> None:
        rng = np.random.default_rng(1)
        prior, likelihoods = np.array([0.5, 0.3, 0.2]), rng.random((4, 20, 3))
        posteriors = prior * likelihoods
        posteriors /= posteriors.sum(axis=2, keepdims=True)
        both = prior * likelihoods.prod(axis=0)
        fused = fuse_predictions([prediction(p) for p in posteriors], prior=7 * prior, weights="one")
        np.testing.assert_allclose(fused.probability, both / both.sum(axis=1, keepdims=True))

    def test_independent_occupancies(self) -> None:
        q_0, likelihood = 0.3, np.array([[2.0, 0.1, 7.0], [3.0, 0.5, 0.2]])  # ratios of occupied to free
        odds = q_0 / (1 - q_0) * likelihood
        known = np.ones(3, dtype=bool)
        halves = [
            prediction(np.full((3, 2), 0.5), occupancy=OccupancyPrediction(o / (1 + o), known)) for o in odds
        ]
        fused = fuse_predictions(halves, prior_occupancy=q_0, weights="one").occupancy
        assert fused is not None
        both = q_0 / (1 - q_0) * likelihood.prod(axis=0)
        np.testing.assert_allclose(fused.probability, both / (1 + both))


def naive(predictions: list[Prediction], prior: Array, v_0: Array | None) -> tuple[Array, Array]:
    """Robust weights (K, M) and probabilities (M, C), number by number."""
    K, M, C = len(predictions), len(predictions[0]), len(prior)
    weights, rows = np.zeros((K, M)), np.zeros((M, C))
    for m in range(M):
        for k, p in enumerate(predictions):
            if p.observed[m] and v_0 is not None and p.variance is not None:
                learned = [math.log(v_0[k, c] / min(p.variance[m, c], v_0[k, c])) / 2 for c in range(C)]
                weights[k, m] = sum(learned) / C
            elif p.observed[m]:
                q = p.probability[m]
                weights[k, m] = sum(q[c] * math.log(q[c] / prior[c]) for c in range(C) if q[c] > 0)
        if weights[:, m].sum() == 0:
            weights[:, m] = [p.observed[m] for p in predictions]
        weights[:, m] /= weights[:, m].sum() or 1
        for c in range(C):
            rows[m, c] = prior[c] ** (1 - weights[:, m].sum())
            for k, p in enumerate(predictions):
                rows[m, c] *= p.probability[m, c] ** weights[k, m]
        rows[m] /= rows[m].sum()
    return weights, rows


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.booleans())
@settings(deadline=None, max_examples=100)
def test_robust_weights(seed: int, K: int, with_variances: bool) -> None:
    rng = np.random.default_rng(seed)
    M, C = 12, int(rng.integers(1, 5))
    prior = rng.dirichlet(np.ones(C))
    v_0 = np.repeat(rng.uniform(0.5, 2, (1, C)), K, axis=0)
    answers = [
        prediction(rng.dirichlet(np.ones(C), M), rng.random(M) < 0.7, rng.uniform(0.01, 1.1, (M, C)) * v_0[0])
        for _ in range(K)
    ]
    fused = fuse_predictions(answers, prior=prior, prior_variance=v_0 if with_variances else None)
    weights, rows = naive(answers, prior, v_0 if with_variances else None)
    np.testing.assert_allclose(fused.probability, rows, rtol=1e-6)
    np.testing.assert_array_equal(fused.observed, np.any([a.observed for a in answers], axis=0))
    assert (fused.variance is not None) == with_variances
    if fused.variance is not None:
        v = [np.minimum(cast("Array", a.variance), v_0[0]) for a in answers]
        precision = (1 - weights.sum(axis=0))[:, None] / v_0[0]
        precision = precision + sum(weights[k][:, None] / v[k] for k in range(K))
        np.testing.assert_allclose(fused.variance, 1 / precision)
