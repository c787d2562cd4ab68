"""Likelihoods against arbitrary-precision arithmetic and quadrature."""

from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from semgp.gp.likelihoods import LIKELIHOODS, Likelihood


def exact_probit(z: mp.mpf) -> tuple[mp.mpf, ...]:
    """Return log Phi(z) and three derivatives, by the textbook formulas in 300 digits."""
    log_p = mp.log1p(-mp.erfc(z / mp.sqrt(2)) / 2) if z > 0 else mp.log(mp.erfc(-z / mp.sqrt(2)) / 2)
    n = mp.exp(-z * z / 2) / mp.sqrt(2 * mp.pi) / mp.exp(log_p)
    return log_p, n, -n * (n + z), n * ((n + z) ** 2 + n * (n + z) - 1)


def exact_logistic(z: mp.mpf) -> tuple[mp.mpf, ...]:
    """Return log 1 / (1 + exp(-z)) and three derivatives."""
    p, q = 1 / (1 + mp.exp(-z)), 1 / (1 + mp.exp(z))
    return -mp.log1p(mp.exp(-z)), q, -p * q, -p * q * (q - p)


EXACT: dict[str, Callable[[mp.mpf], tuple[mp.mpf, ...]]] = {"probit": exact_probit, "logistic": exact_logistic}


def test_every_likelihood_has_a_reference() -> None:
    assert LIKELIHOODS.keys() == EXACT.keys()


@pytest.fixture(params=LIKELIHOODS.values(), ids=lambda likelihood: likelihood.name)
def likelihood(request: pytest.FixtureRequest) -> Likelihood:
    return request.param  # type: ignore[no-any-return]


@pytest.mark.parametrize("f", [-1e3, -100.0, -30.0, -8.0, -5.1, -5.0, -4.9, -1.0, 0.0, 0.5, 3.0, 9.0, 30.0, 1e3])
@pytest.mark.parametrize("y", [1.0, -1.0])
def test_derivatives_are_exact_in_both_tails(likelihood: Likelihood, y: float, f: float) -> None:
    got = likelihood.derivatives(np.array([y]), np.array([f]))
    with mp.workdps(300):
        exact = EXACT[likelihood.name](mp.mpf(y * f))
        for k, (value, reference) in enumerate(zip(got, exact, strict=True)):
            # relative in the tails too, but for values so small that they underflow
            wanted = float(reference) * y**k
            assert value[0] == pytest.approx(wanted, rel=1e-11 if k < 3 or abs(f) < 4.5 else 1e-9, abs=1e-300)


@given(y=st.floats(-1, 1), f=st.floats(-50, 50))
def test_a_soft_label_is_the_mean_of_both(y: float, f: float) -> None:
    for likelihood in LIKELIHOODS.values():
        soft = likelihood.derivatives(np.array([y]), np.array([f]))
        yes, no = (likelihood.derivatives(np.array([s]), np.array([f])) for s in (1.0, -1.0))
        for k in range(4):
            expected = (1 + y) / 2 * yes[k] + (1 - y) / 2 * no[k]
            np.testing.assert_allclose(soft[k], expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("variance", [1e-6, 0.3, 0.99, 1.01, 4.0, 1e4])
@pytest.mark.parametrize("mean", [-30.0, -2.0, 0.0, 0.7, 12.0])
def test_averages_match_quadrature(likelihood: Likelihood, mean: float, variance: float) -> None:
    s = np.sqrt(variance)

    def integrand(z: float) -> float:
        return float(likelihood.sigmoid(np.array(mean + s * z)) * np.exp(-z * z / 2) / np.sqrt(2 * np.pi))

    step = np.clip(-mean / s, -12, 12)
    expected = quad(integrand, -12, step, epsabs=1e-14)[0] + quad(integrand, step, 12, epsabs=1e-14)[0]
    got = likelihood.averaged(np.array([mean]), np.array([variance]))[0]
    assert got == pytest.approx(expected, abs=1e-11)
    log_z, _, _ = likelihood.log_z(np.array([1.0]), np.array([mean]), np.array([variance]))
    assert np.exp(log_z[0]) == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("variance", [0.2, 3.0, 200.0])
@pytest.mark.parametrize("y", [1.0, -1.0])
def test_derivatives_of_the_average_match_differences(likelihood: Likelihood, y: float, variance: float) -> None:
    mean, step = np.linspace(-6, 6, 7), 1e-5
    y_all, v_all = np.full(7, y), np.full(7, variance)
    _, d1, d2 = likelihood.log_z(y_all, mean, v_all)
    up, d1_up, _ = likelihood.log_z(y_all, mean + step, v_all)
    down, d1_down, _ = likelihood.log_z(y_all, mean - step, v_all)
    np.testing.assert_allclose(d1, (up - down) / (2 * step), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(d2, (d1_up - d1_down) / (2 * step), rtol=1e-6, atol=1e-8)
