"""The core against the paper's own toolbox; see tests/reference/README.md."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from semgp.gp.covariance import Covariance, DenseCovariance
from semgp.gp.ep import expectation_propagation
from semgp.gp.expert import covariance
from semgp.gp.fitc import FITCCovariance
from semgp.gp.hyperparameters import Bounds, learn
from semgp.gp.kernels import Kernel
from semgp.gp.laplace import gradient_in_mean, laplace
from semgp.gp.likelihoods import Probit
from tests.gp.golden import HYPER, VALUES, Q, U, X, kernel, relative_error, targets

PROBIT = Probit()
LAPLACE = [name for name in VALUES if "_ep" not in name and "_opt" not in name]
EP = [name for name in VALUES if "_ep" in name]


@pytest.mark.parametrize("name", LAPLACE)
def test_laplace_matches_the_toolbox(name: str) -> None:
    c, setting, structure, *kind = name.split("_")
    k = kernel(setting, "".join(kind))
    K = covariance(k, X, U if structure == "fitc" else None)
    if kind == ["absjit"]:
        K = FITCCovariance(k, X, U, absolute_jitter=True)
    m = HYPER[setting]["mean"]
    posterior = laplace(K, PROBIT, targets(int(c[1])), m)
    term = posterior.term(K)
    mean, variance = (part[:, 0] for part in K.predictor([term])(Q))
    golden = VALUES[name]
    assert posterior.converged
    assert relative_error(posterior.nlml, golden["nlml"]) < 1e-6
    assert relative_error(K.gradient([term]), golden["dcov"]) < 1e-6
    assert relative_error(gradient_in_mean(term), golden["dmean"]) < 1e-6
    assert relative_error(mean + m, golden["fmu"]) < 1e-6
    assert relative_error(variance, golden["fs2"]) < 1e-6
    assert relative_error(PROBIT.averaged(mean + m, variance), golden["p"]) < 1e-6


@pytest.mark.parametrize("name", EP)
def test_expectation_propagation_matches_the_toolbox(name: str) -> None:
    c, setting, *_ = name.split("_")
    # the toolbox's loose runs stop early: they bound its own error, not ours
    tolerance = 1e-6 if name.endswith("tight") else 5e-3
    K = DenseCovariance(kernel(setting), X)
    m = HYPER[setting]["mean"]
    ep = expectation_propagation(K, PROBIT, targets(int(c[1])), m)
    mean, variance = (part[:, 0] for part in K.predictor([ep.term])(Q))
    golden = VALUES[name]
    assert ep.converged
    assert relative_error(ep.nlml, golden["nlml"]) < min(tolerance, 1e-6)
    assert relative_error(K.gradient([ep.term]), golden["dcov"]) < tolerance
    assert relative_error(gradient_in_mean(ep.term), golden["dmean"]) < tolerance
    assert relative_error(mean + m, golden["fmu"]) < tolerance
    assert relative_error(variance, golden["fs2"]) < tolerance
    assert relative_error(PROBIT.averaged(mean + m, variance), golden["p"]) < tolerance


@pytest.mark.parametrize("structure", ["dense", "fitc"])
@pytest.mark.parametrize("c", range(4))
def test_model_selection_goes_as_low_as_the_toolbox(c: int, structure: str) -> None:
    structures: dict[str, Callable[[Kernel], Covariance[Any]]] = {
        "dense": lambda kernel: DenseCovariance(kernel, X),
        "fitc": lambda kernel: FITCCovariance(kernel, X, U),
    }
    learned = learn(
        structures[structure],
        kernel("A"),
        PROBIT,
        targets(c)[:, None],
        np.array([HYPER["A"]["mean"]]),
        Bounds(ell=(1e-4, 1e8), sf=(1e-4, 1e4)),
        restarts=2,
        max_iterations=200,
    )
    assert learned.nlml <= VALUES[f"c{c}_opt200_{structure}"]["nlml"]
    assert learned.converged
