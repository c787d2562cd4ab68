"""Model selection: bounds, priors, restarts, seeds; and the choice of inducing points."""

import numpy as np
import pytest

from semgp.errors import InputError
from semgp.gp.covariance import DenseCovariance
from semgp.gp.hyperparameters import Bounds, Learned, LogNormalPrior, learn
from semgp.gp.inducing import INDUCING, inducing_points
from semgp.gp.likelihoods import Probit
from semgp.gp.stationary import Matern52
from tests.gp.golden import X, targets

Y = np.column_stack([targets(0), targets(1)])[::3]


def learned(**settings: object) -> Learned:
    start = Matern52(ell=(0.5, 0.5, 0.5), sf=1.5)
    m = np.array([-0.5, -0.5])
    return learn(lambda k: DenseCovariance(k, X[::3]), start, Probit(), Y, m, **settings)  # type: ignore[arg-type]


def test_it_improves_the_evidence_and_says_how_it_went() -> None:
    calls: list[float] = []
    result = learned(max_iterations=50, progress=lambda n, nlml: calls.append(nlml))
    assert result.converged
    assert result.nlml < calls[0]
    assert result.evaluations == len(calls)
    assert result.gradient_norm < 0.1
    assert result.m.shape == (2,)


def test_it_says_when_it_stopped_early() -> None:
    result = learned(max_iterations=1)
    assert not result.converged
    assert result.iterations == 1


def test_bounds_hold() -> None:
    result = learned(bounds=Bounds(ell=(0.3, 0.6), sf=(0.5, 2.0), mean=(-0.6, 0.6)))
    kernel = result.kernel
    assert isinstance(kernel, Matern52)
    assert all(0.3 - 1e-9 <= ell <= 0.6 + 1e-9 for ell in kernel.ell)
    assert 0.5 - 1e-9 <= kernel.sf <= 2.0 + 1e-9
    assert np.abs(result.m).max() <= 0.6 + 1e-9
    with pytest.raises(InputError, match="bounds on ell"):
        Bounds(ell=(1.0, 0.1))


def test_a_prior_pulls_towards_its_median() -> None:
    free = learned()
    pulled = learned(prior=LogNormalPrior(ell=(0.2, 0.01), sf=(1.0, 0.01)))
    assert isinstance(pulled.kernel, Matern52)
    np.testing.assert_allclose(pulled.kernel.ell, 0.2, rtol=0.1)
    assert pulled.kernel.sf == pytest.approx(1.0, rel=0.1)
    assert pulled.nlml > free.nlml


def test_restarts_never_lose_and_depend_on_the_seed_alone() -> None:
    one, more, again = learned(), learned(restarts=2, seed=5), learned(restarts=2, seed=5)
    assert more.nlml <= one.nlml + 1e-9
    assert len(more.nlml_of_runs) == 3
    assert more.nlml_of_runs == again.nlml_of_runs


@pytest.mark.parametrize("method", INDUCING)
class TestInducingPoints:
    def test_they_are_distinct_and_in_the_scene(self, method: str) -> None:
        U = inducing_points(X, 40, method)
        assert U.shape == (40, 3)
        assert len(np.unique(U, axis=0)) == 40
        assert (X.min(axis=0) <= U).all()
        assert (X.max(axis=0) >= U).all()

    def test_the_seed_decides(self, method: str) -> None:
        np.testing.assert_array_equal(inducing_points(X, 10, method, 1), inducing_points(X, 10, method, 1))

    def test_no_more_than_there_are_distinct_points(self, method: str) -> None:
        few = np.repeat(X[:5], 10, axis=0)
        assert len(inducing_points(few, 40, method)) == 5


def test_farthest_points_spread_wider_than_random_ones() -> None:
    def closest_pair(U: np.ndarray) -> float:
        distance = np.linalg.norm(U[:, None] - U, axis=2)
        return float(distance[~np.eye(len(U), dtype=bool)].min())

    assert closest_pair(inducing_points(X, 40, "farthest")) > 2 * closest_pair(inducing_points(X, 40, "random"))


def test_bad_input_for_inducing_points() -> None:
    with pytest.raises(InputError, match="k-medoids"):
        inducing_points(X, 10, "k-medoids")
    with pytest.raises(InputError, match="at least one"):
        inducing_points(X, 0)
