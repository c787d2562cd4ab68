"""Every kernel against the same table of properties; a kernel without a row fails."""

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.gp.kernels import Kernel, Product, Sum, _Pair
from semgp.gp.model import kernel_from_json, kernel_to_json
from semgp.gp.stationary import Matern12, Matern32, Matern52, SquaredExponential, Stationary

KERNELS: list[Kernel] = [
    *(kind(ell=(0.5, 1.2, 0.8, 2.0), sf=1.7) for kind in (Matern12, Matern32, Matern52, SquaredExponential)),
    Matern52(ell=(0.9,), sf=0.4),
    Matern32(ell=(0.5, 0.7), sf=1.1, dims=(3, 1)),
    Matern52(ell=(0.9,), sf=0.4) + SquaredExponential(ell=(2.0,), sf=1.3, dims=(0, 2)),
    Matern12(ell=(0.9,), sf=0.4) * Matern32(ell=(2.0, 1.0), sf=1.3, dims=(0, 2)),
]


@pytest.fixture
def inputs() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(0)
    X = rng.normal(size=(12, 4))
    X[5] = X[3]  # duplicates must not hurt
    return X, np.vstack([rng.normal(size=(7, 4)), X[:2]])


def subclasses(kind: type) -> set[type]:
    found: set[type] = {kind}
    child: type
    for child in kind.__subclasses__():
        found |= subclasses(child)
    return found


def test_every_kernel_has_a_row() -> None:
    assert {type(k) for k in KERNELS} == subclasses(Kernel) - {Kernel, Stationary, _Pair}


@pytest.mark.parametrize("kernel", KERNELS, ids=str)
class TestKernel:
    def test_is_symmetric_and_positive_definite(self, kernel: Kernel, inputs: tuple) -> None:  # type: ignore[type-arg]
        X, Z = inputs
        K = kernel(X, X)
        np.testing.assert_allclose(K, K.T, rtol=1e-14)
        np.testing.assert_allclose(np.diag(K), kernel.diag(X), rtol=1e-14)
        np.testing.assert_allclose(kernel(X, Z), kernel(Z, X).T, rtol=1e-14)
        assert np.linalg.eigvalsh(K).min() > -1e-12

    def test_gradient_matches_differences(self, kernel: Kernel, inputs: tuple) -> None:  # type: ignore[type-arg]
        X, Z = inputs
        rng = np.random.default_rng(1)
        G, g = rng.normal(size=(len(X), len(Z))), rng.normal(size=len(X))
        step = 1e-6
        for p in range(len(kernel.theta)):
            up, down = (kernel.with_theta(kernel.theta + s * np.eye(len(kernel.theta))[p]) for s in (step, -step))
            expected = np.vdot(up(X, Z) - down(X, Z), G) / (2 * step)
            assert kernel.contract(X, Z, G)[p] == pytest.approx(expected, rel=1e-7, abs=1e-8)
            expected = np.vdot(up.diag(X) - down.diag(X), g) / (2 * step)
            assert kernel.contract_diag(X, g)[p] == pytest.approx(expected, rel=1e-7, abs=1e-8)

    def test_parameters_round_trip(self, kernel: Kernel, inputs: tuple) -> None:  # type: ignore[type-arg]
        assert len(kernel.parameter_names) == len(kernel.theta)
        np.testing.assert_allclose(kernel.with_theta(kernel.theta).theta, kernel.theta, rtol=1e-14)
        assert kernel_from_json(kernel_to_json(kernel)) == kernel


def test_closed_forms() -> None:
    x, z = np.array([[0.0, 0.0]]), np.array([[0.3, 0.8]])
    r = np.hypot(0.3 / 0.5, 0.8 / 2.0)
    ell, t3, t5 = (0.5, 2.0), np.sqrt(3) * r, np.sqrt(5) * r
    assert Matern12(ell, 2.0)(x, z)[0, 0] == pytest.approx(4 * np.exp(-r))
    assert Matern32(ell, 2.0)(x, z)[0, 0] == pytest.approx(4 * (1 + t3) * np.exp(-t3))
    assert Matern52(ell, 2.0)(x, z)[0, 0] == pytest.approx(4 * (1 + t5 + t5**2 / 3) * np.exp(-t5))
    assert SquaredExponential(ell, 2.0)(x, z)[0, 0] == pytest.approx(4 * np.exp(-(r**2) / 2))


def test_algebra_is_that_of_matrices(inputs: tuple) -> None:  # type: ignore[type-arg]
    X, Z = inputs
    a, b = KERNELS[0], KERNELS[4]
    np.testing.assert_allclose(Sum(a, b)(X, Z), a(X, Z) + b(X, Z))
    np.testing.assert_allclose(Product(a, b)(X, Z), a(X, Z) * b(X, Z))


@pytest.mark.parametrize(
    "bad", [{"ell": (0.0,)}, {"ell": (-1.0,)}, {"ell": (1.0,), "sf": np.nan}, {"ell": (np.inf,)}]
)
def test_parameters_must_be_positive(bad: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(InputError, match="positive"):
        Matern52(**bad)


def test_length_scales_must_fit_the_inputs() -> None:
    with pytest.raises(InputError, match="2 length scales do not fit inputs of 3 dimensions"):
        Matern52(ell=(1.0, 1.0))(np.zeros((2, 3)), np.zeros((2, 3)))
    with pytest.raises(InputError, match="active dimensions"):
        Matern52(ell=(1.0, 1.0), dims=(0, 1, 2))
