"""Laplace's approximation: convergence, evidence, gradients, and agreement between structures."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.gaussian_process import GaussianProcessClassifier
from sklearn.gaussian_process import kernels as sk

from semgp.errors import InputError
from semgp.gp.covariance import Covariance, DenseCovariance
from semgp.gp.fitc import FITCCovariance
from semgp.gp.kernels import Kernel
from semgp.gp.laplace import gradient_in_mean, laplace
from semgp.gp.likelihoods import LIKELIHOODS, Likelihood, Logistic, Probit
from semgp.gp.one_vs_rest import binary_targets, class_posteriors, nlml_gradient
from semgp.gp.stationary import Matern12, Matern32, Matern52, SquaredExponential
from tests.gp.golden import LABELS, Q, U, X, targets

DENSE = DenseCovariance
KERNELS = [
    *(kind(ell=(0.5, 0.7, 0.6), sf=1.5) for kind in (Matern12, Matern32, Matern52, SquaredExponential)),
    Matern52(ell=(0.6,), sf=1.2) + Matern32(ell=(2.0,), sf=0.7, dims=(2,)),
    Matern52(ell=(0.6,), sf=1.2) * SquaredExponential(ell=(2.0,), sf=0.9, dims=(0, 1)),
]
STRUCTURES: dict[str, Callable[[Kernel], Covariance]] = {  # type: ignore[type-arg]
    "dense": lambda kernel: DenseCovariance(kernel, X[::3]),
    "fitc": lambda kernel: FITCCovariance(kernel, X[::3], U[::2]),
}


@pytest.mark.parametrize("likelihood", LIKELIHOODS.values(), ids=lambda likelihood: likelihood.name)
@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("kernel", KERNELS, ids=str)
def test_gradients_match_differences(kernel: Kernel, structure: str, likelihood: Likelihood) -> None:
    covariance, y, m = STRUCTURES[structure], targets(0)[::3], -0.4
    # a soft label in between must not break anything
    y = np.where(np.arange(len(y)) == 5, 0.3, y)

    def nlml(kernel: Kernel, m: float) -> float:
        return laplace(covariance(kernel), likelihood, y, m, tolerance=1e-14).nlml

    K = covariance(kernel)
    term = laplace(K, likelihood, y, m, tolerance=1e-14).term(K)
    gradient, step = K.gradient([term]), 1e-5
    for p, direction in enumerate(np.eye(len(kernel.theta))):
        up, down = (kernel.with_theta(kernel.theta + s * direction) for s in (step, -step))
        expected = (nlml(up, m) - nlml(down, m)) / (2 * step)
        assert gradient[p] == pytest.approx(expected, rel=2e-5, abs=2e-6)
    expected = (nlml(kernel, m + step) - nlml(kernel, m - step)) / (2 * step)
    assert gradient_in_mean(term) == pytest.approx(expected, rel=2e-5, abs=2e-6)


def test_dense_logistic_agrees_with_scikit_learn() -> None:
    theirs = sk.ConstantKernel(1.7**2) * sk.Matern(length_scale=[0.5, 0.7, 0.6], nu=2.5)
    gpc = GaussianProcessClassifier(theirs, optimizer=None).fit(X, targets(0))
    expected, d_theta = gpc.log_marginal_likelihood(gpc.kernel_.theta, eval_gradient=True)
    K = DenseCovariance(Matern52(ell=(0.5, 0.7, 0.6), sf=1.7), X)
    posterior = laplace(K, Logistic(), targets(0), 0.0)
    term = posterior.term(K)
    assert posterior.nlml == pytest.approx(-expected, rel=1e-8)
    # their first parameter is log sf^2
    gradient = K.gradient([term])
    np.testing.assert_allclose(gradient, -np.append(d_theta[1:], 2 * d_theta[0]), rtol=1e-6)
    mean, variance = K.predictor([term])(Q)
    f, s2 = gpc.latent_mean_and_variance(Q)
    np.testing.assert_allclose(mean[:, 0], f, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(variance[:, 0], s2, rtol=1e-8, atol=1e-8)


def test_fitc_with_inducing_points_at_the_training_points_is_dense() -> None:
    kernel, y = Matern52(ell=(0.5, 0.7, 0.6), sf=1.5), targets(1)
    dense, fitc = DenseCovariance(kernel, X), FITCCovariance(kernel, X, X, jitter=1e-12)
    a, b = laplace(dense, Probit(), y, -0.5), laplace(fitc, Probit(), y, -0.5)
    assert b.nlml == pytest.approx(a.nlml, rel=1e-8)
    np.testing.assert_allclose(fitc.gradient([b.term(fitc)]), dense.gradient([a.term(dense)]), rtol=1e-6)
    for got, expected in zip(fitc.predictor([b.term(fitc)])(Q), dense.predictor([a.term(dense)])(Q), strict=True):
        np.testing.assert_allclose(got, expected, atol=2e-6)


def test_fitc_is_the_covariance_that_it_says() -> None:
    kernel = Matern52(ell=(0.5, 0.7, 0.6), sf=1.5)
    K_uu, K_uf = kernel(U, U), kernel(U, X)
    K_uu[np.diag_indices(len(U))] += 1e-6 * 1.5**2
    Q_ff = K_uf.T @ np.linalg.solve(K_uu, K_uf)
    naive = Q_ff + np.diag(kernel.diag(X) - np.diag(Q_ff))
    K = FITCCovariance(kernel, X, U)
    W = np.random.default_rng(0).uniform(0, 1, len(X))
    W[:40] = 0
    factor = K.factorise(W)
    R = np.linalg.inv(naive + np.diag(1 / np.maximum(W, 1e-12)))
    v = np.random.default_rng(1).normal(size=len(X))
    np.testing.assert_allclose(K.matvec(v), naive @ v, atol=1e-8)
    np.testing.assert_allclose(factor.solve(v), R @ v, atol=1e-7)
    np.testing.assert_allclose(factor.R_diagonal(), np.diag(R), atol=1e-7)
    np.testing.assert_allclose(factor.marginal_variance(), np.diag(naive - naive @ R @ naive), atol=1e-7)
    sign, log_det = np.linalg.slogdet(np.eye(len(X)) + naive * W)
    assert sign > 0
    assert factor.log_det_B == pytest.approx(log_det, rel=1e-9)


@pytest.mark.parametrize("likelihood", LIKELIHOODS.values(), ids=lambda likelihood: likelihood.name)
@pytest.mark.parametrize("sf", [1e-3, 1.0, 100.0, 1000.0])
@pytest.mark.parametrize("structure", ["dense", "fitc"])
def test_newton_converges_at_any_signal_deviation(structure: str, sf: float, likelihood: Likelihood) -> None:
    kernel = Matern52(ell=(0.5, 0.7, 0.6), sf=sf)
    K: Covariance = DENSE(kernel, X) if structure == "dense" else FITCCovariance(kernel, X, U)  # type: ignore[type-arg]
    posterior = laplace(K, likelihood, targets(2), -1.0)
    assert posterior.converged
    # at the mode the gradient vanishes: a = d log p / df
    np.testing.assert_allclose(posterior.a, posterior.likelihood_at_mode.d1, atol=1e-5)


def test_it_says_when_it_did_not_converge() -> None:
    K = DenseCovariance(Matern52(ell=(0.5,), sf=100.0), X)
    posterior = laplace(K, Probit(), targets(2), 0.0, max_iterations=1)
    assert not posterior.converged
    assert posterior.iterations == 1


def test_a_warm_start_gives_the_same_mode() -> None:
    K = DenseCovariance(Matern52(ell=(0.5,), sf=3.0), X)
    cold = laplace(K, Probit(), targets(0), -0.5)
    warm = laplace(K, Probit(), targets(0), -0.5, a=cold.a)
    assert warm.iterations < cold.iterations
    assert warm.nlml == pytest.approx(cold.nlml, abs=1e-9)


def test_classes_side_by_side_equal_one_by_one() -> None:
    K = FITCCovariance(Matern52(ell=(0.5, 0.7, 0.6), sf=3.0), X, U)
    m = np.array([-0.8, 0.2, -1.0, 0.0])
    Y = np.column_stack([targets(c) for c in range(4)])
    together = class_posteriors(K, Probit(), Y, m)
    d_theta, d_m, terms = nlml_gradient(K, together)
    alone = [laplace(K, Probit(), Y[:, c], m[c]) for c in range(4)]
    gradients = [K.gradient([posterior.term(K)]) for posterior in alone]
    np.testing.assert_allclose([p.nlml for p in together], [p.nlml for p in alone], rtol=1e-12)
    np.testing.assert_allclose(d_theta, np.sum(gradients, axis=0), rtol=1e-8)
    np.testing.assert_allclose(d_m, [gradient_in_mean(p.term(K)) for p in alone], rtol=1e-8)
    mean, variance = K.predictor(terms)(Q)
    for c in range(4):
        one_mean, one_variance = K.predictor([terms[c]])(Q)
        np.testing.assert_allclose(mean[:, c], one_mean[:, 0], rtol=1e-10)
        np.testing.assert_allclose(variance[:, c], one_variance[:, 0], rtol=1e-5)


def test_targets_come_from_weights() -> None:
    weights: NDArray[np.float64] = (LABELS[:, None] == np.arange(4)).astype(float)
    np.testing.assert_array_equal(binary_targets(weights)[:, 1], targets(1))
    np.testing.assert_allclose(binary_targets(np.array([[1.0, 3.0]])), [[-0.5, 0.5]])
    for bad in (np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([[1.0, 0.0]]), np.array([[2.0, -1.0]])):
        with pytest.raises(InputError, match="positive weight"):
            binary_targets(bad)


class TestBadInput:
    @pytest.mark.parametrize("bad", [np.full((3, 3), np.nan), np.zeros((0, 3)), np.zeros(3)])
    def test_inputs(self, bad: NDArray[np.float64]) -> None:
        for structure in (lambda: DenseCovariance(Matern52(ell=(1.0,)), bad), lambda: self._fitc(X, bad)):
            with pytest.raises(InputError, match="inputs"):
                structure()

    def test_dimensions_that_differ(self) -> None:
        with pytest.raises(InputError, match="3 dimensions, inducing inputs 2"):
            self._fitc(X, U[:, :2])

    def test_inducing_points_on_top_of_each_other(self) -> None:
        same = np.repeat(U[:1], 30, axis=0)
        with pytest.raises(InputError, match="raise the jitter"):
            FITCCovariance(Matern52(ell=(1.0,)), X, same, jitter=0.0)

    @staticmethod
    def _fitc(X: NDArray[np.float64], U: NDArray[np.float64]) -> FITCCovariance:
        return FITCCovariance(Matern52(ell=(1.0,)), X, U)
