"""Seconds of the GP core at the paper's size, and beside scikit-learn as far as that goes.

    uv run benchmarks/gp_core.py [--json FILE]

The scene is synthetic, so that anyone can run it: 5,000 training points, 300 inducing points, 13 classes, 307,200
queries. The paper's own toolbox (GPML 4.2) took 15.6 s for NLML and gradient at this size, and 84 s a class to
predict, on a machine of the same kind.
"""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from sklearn.gaussian_process import GaussianProcessClassifier
from sklearn.gaussian_process import kernels as sk

from semgp.gp.covariance import DenseCovariance
from semgp.gp.fitc import FITCCovariance
from semgp.gp.inducing import inducing_points
from semgp.gp.kernels import Array
from semgp.gp.laplace import laplace
from semgp.gp.likelihoods import Logistic, Probit
from semgp.gp.one_vs_rest import binary_targets, class_posteriors, nlml_gradient
from semgp.gp.probability import class_probability
from semgp.gp.stationary import Matern52
from semgp.scene.scan import synthetic_room
from semgp.scene.sensor import DepthCamera

N, INDUCING, QUERIES = 5000, 300, 307_200


def best_of(work: Callable[[], object], repeats: int) -> float:
    """Return the least wall-clock seconds; a first run compiles and warms up."""
    work()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()

    room = synthetic_room(camera=DepthCamera(width=640, height=480))
    clouds = [room.scan(view).truth for view in (0, 8, 16)]
    rng = np.random.default_rng(0)
    points = np.concatenate([cloud.points for cloud in clouds])
    weights = np.concatenate([cloud.class_weights for cloud in clouds]).astype(np.float64)
    chosen = rng.permutation(len(points))[:N]
    X, Y = points[chosen], binary_targets(weights[chosen][:, weights[chosen].any(axis=0)])
    queries = points[rng.permutation(len(points))[:QUERIES]]
    m, C = np.full(Y.shape[1], -1.0), Y.shape[1]
    U = inducing_points(X, INDUCING)
    results: dict[str, float] = {"classes": C, "queries": len(queries)}

    for sf in (2.0, 10.0, 50.0):
        kernel = Matern52(ell=(0.3, 0.3, 0.3), sf=sf)

        def evidence(kernel: Matern52 = kernel) -> object:
            K = FITCCovariance(kernel, X, U)
            return nlml_gradient(K, class_posteriors(K, Probit(), Y, m))

        results[f"NLML and gradient, cold start, sf {sf:g}"] = best_of(evidence, options.repeats)
        before = FITCCovariance(kernel.with_theta(kernel.theta + 0.02), X, U)
        modes = [posterior.a for posterior in class_posteriors(before, Probit(), Y, m)]

        def next_step(kernel: Matern52 = kernel, modes: list[Array] = modes) -> object:
            K = FITCCovariance(kernel, X, U)
            return nlml_gradient(K, class_posteriors(K, Probit(), Y, m, modes))

        results[f"the same, from modes for parameters 2 % away, sf {sf:g}"] = best_of(next_step, options.repeats)
    K = FITCCovariance(Matern52(ell=(0.3, 0.3, 0.3), sf=10.0), X, U)
    _, _, terms = nlml_gradient(K, class_posteriors(K, Probit(), Y, m))
    predictor = K.predictor(terms)

    def predict() -> object:
        mean, variance = predictor(queries)
        mean += m
        return class_probability("softmax", Probit(), mean, variance)

    results[f"{len(queries):,} queries: mean, variance, probability"] = best_of(predict, options.repeats)

    y, few = Y[:1000, 0], X[:1000]
    dense = Matern52(ell=(0.3, 0.3, 0.3), sf=2.0)
    theirs = GaussianProcessClassifier(sk.ConstantKernel(4.0) * sk.Matern([0.3, 0.3, 0.3], nu=2.5), optimizer=None)
    theirs.fit(few, y)

    def ours() -> object:
        K = DenseCovariance(dense, few)
        return K.gradient([laplace(K, Logistic(), y, 0.0).term(K)])

    results["dense, 1,000 points, one class: ours"] = best_of(ours, options.repeats)
    results["dense, 1,000 points, one class: scikit-learn"] = best_of(
        lambda: theirs.log_marginal_likelihood(theirs.kernel_.theta, eval_gradient=True), options.repeats
    )

    table = Table("", "value", title=f"GP core: {N:,} points, {INDUCING} inducing, {C} classes")
    for name, value in results.items():
        table.add_row(name, f"{value:,}" if isinstance(value, int) else f"{value:.3f} s")
    Console().print(table)
    if options.json:
        options.json.write_text(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
