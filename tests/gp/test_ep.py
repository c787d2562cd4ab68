"""Expectation propagation beyond the golden values: moments against quadrature, both likelihoods."""

import numpy as np
import pytest
from scipy.integrate import quad

from semgp.gp.covariance import DenseCovariance
from semgp.gp.ep import expectation_propagation
from semgp.gp.laplace import gradient_in_mean
from semgp.gp.likelihoods import LIKELIHOODS, Likelihood
from semgp.gp.stationary import Matern52
from tests.gp.golden import X, targets


@pytest.fixture(params=LIKELIHOODS.values(), ids=lambda likelihood: likelihood.name)
def likelihood(request: pytest.FixtureRequest) -> Likelihood:
    return request.param  # type: ignore[no-any-return]


@pytest.mark.parametrize(("sf", "m", "y"), [(2.0, 0.5, 1.0), (2.0, 0.5, -1.0), (0.4, -1.0, 1.0), (6.0, 2.0, -1.0)])
def test_one_point_is_exact(likelihood: Likelihood, sf: float, m: float, y: float) -> None:
    K = DenseCovariance(Matern52(ell=(1.0,), sf=sf), np.zeros((1, 3)))
    ep = expectation_propagation(K, likelihood, np.array([y]), m)

    def moment(k: int) -> float:
        def integrand(f: float) -> float:
            density = np.exp(-(((f - m) / sf) ** 2) / 2) / np.sqrt(2 * np.pi) / sf
            return float(f**k * likelihood.sigmoid(np.array(y * f)) * density)

        return float(quad(integrand, m - 10 * sf, m + 10 * sf, epsabs=1e-12)[0])

    z = moment(0)
    mean, variance = K.predictor([ep.term])(np.zeros((1, 3)))
    assert ep.nlml == pytest.approx(-np.log(z), rel=1e-8)
    assert mean[0, 0] + m == pytest.approx(moment(1) / z, rel=1e-7)
    assert variance[0, 0] == pytest.approx(moment(2) / z - (moment(1) / z) ** 2, rel=1e-6)


def test_gradients_match_differences(likelihood: Likelihood) -> None:
    kernel, y, m, step = Matern52(ell=(0.5, 0.7, 0.6), sf=2.0), targets(1)[::6], -0.3, 1e-5

    def nlml(kernel: Matern52, m: float) -> float:
        return expectation_propagation(DenseCovariance(kernel, X[::6]), likelihood, y, m).nlml

    K = DenseCovariance(kernel, X[::6])
    ep = expectation_propagation(K, likelihood, y, m)
    for p, direction in enumerate(np.eye(4)):
        up, down = (kernel.with_theta(kernel.theta + s * direction) for s in (step, -step))
        assert K.gradient([ep.term])[p] == pytest.approx(
            (nlml(up, m) - nlml(down, m)) / (2 * step), rel=1e-4, abs=1e-6
        )
    expected = (nlml(kernel, m + step) - nlml(kernel, m - step)) / (2 * step)
    assert gradient_in_mean(ep.term) == pytest.approx(expected, rel=1e-4)


def test_it_says_when_it_did_not_converge(likelihood: Likelihood) -> None:
    K = DenseCovariance(Matern52(ell=(0.5,), sf=5.0), X[::6])
    ep = expectation_propagation(K, likelihood, targets(0)[::6], 0.0, max_sweeps=1)
    assert not ep.converged
    assert ep.sweeps == 1
