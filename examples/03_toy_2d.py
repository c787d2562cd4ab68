"""The paper's toy example: three classes in the plane, one-vs-rest Gaussian-process classification.

    uv run examples/03_toy_2d.py --out toy.png

Each upper panel shows the log-probability of one class as a surface with its contour curves; below, all classes
together: the most probable class with the training points, the entropy, and the latent deviation, which grows
away from the data where the probabilities of the plug-in rule alone stay sure of themselves.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from semgp.gp.covariance import DenseCovariance
from semgp.gp.hyperparameters import Bounds, learn
from semgp.gp.kernels import Array
from semgp.gp.likelihoods import Probit
from semgp.gp.one_vs_rest import binary_targets, class_posteriors, nlml_gradient
from semgp.gp.probability import averaged
from semgp.gp.stationary import Matern52

COLOURS = ("#3465a4", "#f57900", "#4e9a06")


def three_blobs(n: int = 40, seed: int = 0) -> tuple[Array, Array]:
    """Return n points of each of three overlapping classes, (3 n, 2), and their class weights (3 n, 3)."""
    rng = np.random.default_rng(seed)
    ring = np.linspace(0.2, np.pi - 0.2, n)
    arc = np.column_stack([2 * np.cos(ring), 2 * np.sin(ring) - 0.4]) + rng.normal(scale=0.22, size=(n, 2))
    left = rng.normal((-0.6, -0.9), (0.55, 0.35), (n, 2))
    right = rng.normal((0.9, 0.2), (0.3, 0.55), (n, 2))
    return np.vstack([arc, left, right]), np.repeat(np.eye(3), n, axis=0)


def surface(axes: Axes3D, X: Array, Y: Array, log_p: Array, title: str) -> None:
    floor = float(log_p.min()) - 2.5
    axes.plot_surface(X, Y, log_p, cmap="viridis", rstride=2, cstride=2, linewidth=0, antialiased=True)
    axes.contour(X, Y, log_p, levels=10, cmap="viridis", offset=floor, linewidths=0.8)
    axes.set(zlim=(floor, 0), title=title, xlabel="$x_1$", ylabel="$x_2$")
    axes.set_zlabel("log p")
    axes.view_init(elev=32, azim=-62)


def flat(axes: Axes, X: Array, Y: Array, values: Array, title: str, label: str) -> None:
    filled = axes.contourf(X, Y, values, levels=14, cmap="magma")
    axes.figure.colorbar(filled, ax=axes, label=label, shrink=0.85)
    axes.set(title=title, xlabel="$x_1$", ylabel="$x_2$", aspect="equal")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("toy_2d.png"))
    out = parser.parse_args().out

    points, weights = three_blobs()
    targets = binary_targets(weights)
    learned = learn(
        lambda kernel: DenseCovariance(kernel, points),
        Matern52(ell=(1.0, 1.0), sf=2.0),
        Probit(),
        targets,
        np.zeros(3),
        Bounds(ell=(0.1, 10), sf=(0.1, 10)),
    )
    K = DenseCovariance(learned.kernel, points)
    posteriors = class_posteriors(K, Probit(), targets, learned.m)
    _, _, terms = nlml_gradient(K, posteriors)
    print(f"{learned.kernel}; NLML {learned.nlml:.2f}, converged: {learned.converged}")

    axis = np.linspace(-3.2, 3.2, 120)
    X, Y = np.meshgrid(axis, axis - 0.2)
    mean, variance = K.predictor(terms)(np.column_stack([X.ravel(), Y.ravel()]))
    p = averaged(Probit(), mean + learned.m, variance)
    entropy = -(p * np.log(p)).sum(axis=1)

    figure = Figure(figsize=(13, 8.4), layout="constrained")
    FigureCanvasAgg(figure)
    for c in range(3):
        axes = figure.add_subplot(2, 3, c + 1, projection="3d")
        assert isinstance(axes, Axes3D)
        surface(axes, X, Y, np.log(p[:, c]).reshape(X.shape), f"class {c + 1}: log-probability")
    axes = figure.add_subplot(2, 3, 4)
    axes.imshow(
        p.argmax(axis=1).reshape(X.shape),
        extent=(X.min(), X.max(), Y.min(), Y.max()),
        origin="lower",
        cmap=ListedColormap(COLOURS),
        alpha=0.35,
    )
    for c, colour in enumerate(COLOURS):
        members = points[weights[:, c] > 0]
        axes.plot(*members.T, "o", color=colour, markeredgecolor="white", markersize=6, label=f"class {c + 1}")
        axes.contour(X, Y, p[:, c].reshape(X.shape), levels=(0.5, 0.7, 0.9), colors=colour, linewidths=1.2)
    axes.legend(loc="lower right", framealpha=0.9)
    axes.set(title="most probable class; p = .5, .7, .9", xlabel="$x_1$", ylabel="$x_2$", aspect="equal")
    flat(figure.add_subplot(2, 3, 5), X, Y, entropy.reshape(X.shape), "entropy", "nats")
    deviation = np.sqrt(variance.min(axis=1))
    flat(figure.add_subplot(2, 3, 6), X, Y, deviation.reshape(X.shape), "least latent deviation", "of f")
    figure.savefig(out, dpi=110)
    print(out)


if __name__ == "__main__":
    main()
