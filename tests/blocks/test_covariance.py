"""Covariances and their derivatives, tile by tile, against the kernels in double precision."""

import numpy as np
import pytest

from semgp.blocks.covariance import covariance_lower, covariance_tile, derivative_tile, mixture, stationary_terms
from semgp.blocks.model import BlockModel
from semgp.blocks.objective import _of_theta
from semgp.errors import InputError
from semgp.gp.kernels import Kernel, Product
from semgp.gp.stationary import Matern12, Matern32, Matern52, SquaredExponential
from tests.blocks.naive import Array

KINDS = (Matern12, Matern32, Matern52, SquaredExponential)
KERNELS: list[Kernel] = [
    *(kind(ell=(0.5,), sf=0.8) for kind in KINDS),
    *(kind(ell=(0.5, 1.2, 0.8, 2.0, 0.3), sf=1.7) for kind in KINDS),
    *(kind(ell=(0.9,), sf=0.4, dims=(0, 1, 2)) for kind in KINDS),
    Matern32(ell=(0.5, 0.7), sf=1.1, dims=(3, 1)),
    Matern52(ell=(0.15,), sf=0.3) + Matern12(ell=(2.0,), sf=0.9, dims=(4, 0)),
    Matern52(ell=(0.2,), sf=0.3) + (SquaredExponential(ell=(1.0,), sf=0.7) + Matern32(ell=(9.0,), sf=0.2)),
]
D = 5


@pytest.fixture
def inputs() -> tuple[Array, Array]:
    rng = np.random.default_rng(0)
    X, Z = rng.normal(size=(40, D)), rng.normal(size=(13, D))
    Z[4] = X[7]  # at no distance, square roots have no derivative
    Z[5] = X[8] + 50
    return X.astype(np.float32).astype(np.float64), Z.astype(np.float32).astype(np.float64)


@pytest.mark.parametrize("kernel", KERNELS, ids=str)
def test_covariances(kernel: Kernel, inputs: tuple[Array, Array]) -> None:
    X, Z = inputs
    n, m = len(Z), len(X)
    wide_Z, wide_X = np.full((D, n + 3), np.nan, np.float32), np.full((D, m + 2), np.nan, np.float32)
    wide_Z[:, :n], wide_X[:, :m] = Z.T, X.T  # columns beyond the first n and m are of no account
    K = np.full((n, m), np.nan, dtype=np.float32)
    covariance_tile(wide_Z, n, wide_X, m, mixture(kernel, D), K, np.empty(m, np.float32))
    prior_variance = sum(term.sf**2 for term in stationary_terms(kernel))
    np.testing.assert_allclose(K, kernel(Z, X), rtol=0, atol=6e-7 * prior_variance)


@pytest.mark.parametrize("kernel", KERNELS, ids=str)
@pytest.mark.parametrize("n", [1, 15, 17, 40])
def test_lower_triangles(kernel: Kernel, n: int, inputs: tuple[Array, Array]) -> None:
    X, _ = inputs
    wide, K = np.full((D, n + 2), np.nan, np.float32), np.full((n, n), np.nan, np.float32)
    wide[:, :n] = X[:n].T
    covariance_lower(wide, n, mixture(kernel, D), K, np.empty(n, np.float32))
    prior_variance, below = sum(term.sf**2 for term in stationary_terms(kernel)), np.tril_indices(n)
    np.testing.assert_allclose(K[below], kernel(X[:n], X[:n])[below], rtol=0, atol=6e-7 * prior_variance)
    np.testing.assert_allclose(np.diag(K), prior_variance, rtol=5e-7)


@pytest.mark.parametrize("kernel", KERNELS, ids=str)
def test_derivatives(kernel: Kernel, inputs: tuple[Array, Array]) -> None:
    X, Z = inputs
    H = np.random.default_rng(1).normal(size=(len(Z), len(X))).astype(np.float32)
    packed = mixture(kernel, D)
    out = np.ones((len(packed.kind), D + 1))
    columns = np.ascontiguousarray(Z.T, np.float32), len(Z), np.ascontiguousarray(X.T, np.float32), len(X)
    derivative_tile(*columns, packed, H, -2.0, out, np.empty(len(X), np.float32))
    found = _of_theta(BlockModel(kernel=kernel, features=("a", "b")), (1 - out) / 2)
    np.testing.assert_allclose(found, kernel.contract(Z, X, H.astype(np.float64)), rtol=1e-4, atol=1e-4)


def test_terms_stand_in_the_order_of_the_parameters() -> None:
    kernel = KERNELS[-1]
    theta = np.concatenate([term.theta for term in stationary_terms(kernel)])
    np.testing.assert_array_equal(theta, kernel.theta)


@pytest.mark.parametrize(
    "kernel",
    [
        Product(Matern52((1.0,)), Matern32((1.0,))),
        Matern52((1.0,)) + Matern52((1.0,)) * Matern12((1.0,)),
        Matern52((1.0, 2.0)),
        Matern52((1.0,), dims=(0, D)),
    ],
    ids=str,
)
def test_kernels_that_blocks_do_not_take(kernel: Kernel) -> None:
    with pytest.raises(InputError, match=r"stationary kernels|do not fit"):
        mixture(kernel, D)
