"""Multi-class Laplace against naive dense algebra and differences."""

import numpy as np
import pytest
from scipy.special import softmax

from semgp.gp.kernels import Kernel
from semgp.gp.softmax import softmax_gradient, softmax_laplace, softmax_latent, softmax_probability
from semgp.gp.stationary import Matern52
from tests.gp.golden import LABELS, Q, X

N, C = 50, 4
INPUTS, Y = X[:N], np.eye(C)[LABELS[:N]]
KERNELS: list[Kernel] = [Matern52(ell=(0.5, 0.7, 0.6), sf=1.5 + 0.3 * c) for c in range(C)]
M = np.array([0.1, -0.2, 0.3, 0.0])


def test_mode_evidence_and_latent_match_naive_algebra() -> None:
    posterior = softmax_laplace(KERNELS, INPUTS, Y, M)
    K = np.zeros((C * N, C * N))
    for c, kernel in enumerate(KERNELS):
        K[c * N : (c + 1) * N, c * N : (c + 1) * N] = kernel(INPUTS, INPUTS)
    f = K @ posterior.a.ravel() + np.repeat(M, N)
    pi = softmax(f.reshape(C, N), axis=0)
    Pi = np.vstack([np.diag(row) for row in pi])
    W = np.diag(pi.ravel()) - Pi @ Pi.T
    np.testing.assert_allclose(posterior.a, Y.T - pi, atol=1e-6)  # the gradient vanishes at the mode
    log_det = np.linalg.slogdet(np.eye(C * N) + K @ W)[1]
    log_p = np.log(pi.T[np.arange(N), LABELS[:N]]).sum()
    assert posterior.nlml == pytest.approx(0.5 * posterior.a.ravel() @ (f - np.repeat(M, N)) - log_p + log_det / 2)
    mean, covariance = softmax_latent(posterior, Q)
    inverse = W @ np.linalg.inv(np.eye(C * N) + K @ W)  # (K + W^-1)^-1, W singular
    for i in (0, 17):
        k = np.zeros((C * N, C))
        for c, kernel in enumerate(KERNELS):
            k[c * N : (c + 1) * N, c] = kernel(INPUTS, Q[i : i + 1])[:, 0]
        prior = np.diag([kernel.diag(Q[:1])[0] for kernel in KERNELS])
        np.testing.assert_allclose(mean[i], k.T @ posterior.a.ravel() + M, atol=1e-8)
        np.testing.assert_allclose(covariance[i], prior - k.T @ inverse @ k, atol=1e-8)


def test_gradients_match_differences() -> None:
    d_theta, d_m = softmax_gradient(softmax_laplace(KERNELS, INPUTS, Y, M, tolerance=1e-14))
    step = 1e-5

    def nlml(kernels: list[Kernel], m: np.ndarray) -> float:
        return softmax_laplace(kernels, INPUTS, Y, m, tolerance=1e-14).nlml

    for c in range(C):
        for p, direction in enumerate(np.eye(4)):
            sides = []
            for s in (step, -step):
                moved = list(KERNELS)
                moved[c] = KERNELS[c].with_theta(KERNELS[c].theta + s * direction)
                sides.append(nlml(moved, M))
            assert d_theta[c][p] == pytest.approx((sides[0] - sides[1]) / (2 * step), rel=1e-5, abs=1e-7)
        up, down = (nlml(KERNELS, M + s * np.eye(C)[c]) for s in (step, -step))
        assert d_m[c] == pytest.approx((up - down) / (2 * step), rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("sf", [0.1, 100.0])
def test_newton_converges_at_any_signal_deviation(sf: float) -> None:
    posterior = softmax_laplace([Matern52(ell=(0.6,), sf=sf)] * C, INPUTS, Y, np.zeros(C))
    assert posterior.converged


def test_it_says_when_it_did_not_converge() -> None:
    posterior = softmax_laplace([Matern52(ell=(0.6,), sf=50.0)] * C, INPUTS, Y, np.zeros(C), max_iterations=1)
    assert not posterior.converged


def test_averaged_probability_is_the_integral() -> None:
    mean = np.array([[0.5, -0.3, 0.1]])
    root = np.array([[1.2, 0.0, 0.0], [0.3, 0.8, 0.0], [-0.2, 0.1, 0.5]])
    covariance = (root @ root.T)[None]
    nodes, weights = np.polynomial.hermite_e.hermegauss(20)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    w = np.prod(np.stack(np.meshgrid(weights, weights, weights, indexing="ij"), axis=-1).reshape(-1, 3), axis=1)
    expected = (w[:, None] * softmax(mean + grid @ root.T, axis=1)).sum(axis=0) / w.sum()
    got = softmax_probability(mean, covariance, samples=40_000, seed=3)
    np.testing.assert_allclose(got[0], expected, atol=4e-3)
    np.testing.assert_array_equal(got, softmax_probability(mean, covariance, samples=40_000, seed=3))
