"""Learn a model from a labelled cloud by minimising the negative log marginal likelihood (paper, section IV-C)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.gp.expert import covariance
from semgp.gp.hyperparameters import Bounds, Learned, LogNormalPrior, Progress, learn
from semgp.gp.inducing import inducing_points
from semgp.gp.kernels import Array
from semgp.gp.likelihoods import LIKELIHOODS
from semgp.gp.model import GPModel
from semgp.gp.one_vs_rest import binary_targets
from semgp.maps.training import training_set


def learn_model(
    cloud: LabelledCloud,
    model: GPModel | None = None,
    *,
    per_class: bool = False,
    bounds: Bounds | None = None,
    prior: LogNormalPrior | None = None,
    restarts: int = 0,
    max_iterations: int = 30,
    progress: Progress | None = None,
) -> tuple[GPModel, Sequence[Learned]]:
    """Return the model with learned kernel and means, and how the search went.

    The evidence is Laplace's for one-vs-rest classification, whatever inference the model names: EP and softmax
    share its kernels, and the search stays affordable.

    Parameters
    ----------
    cloud : LabelledCloud
        At least two classes with labels.
    model : GPModel, optional
        Where the search starts; its likelihood, sizes and seed are kept.
    per_class : bool, optional
        Learn a kernel for each class, instead of one that the classes share. The mean is each class's own in
        both cases.
    bounds, prior : optional
        Bounds on, and log-normal priors of, length scales and signal deviation.
    restarts : int, optional
        Further starts, drawn with the model's seed.
    max_iterations : int, optional
        Limit of search steps a run.
    progress : callable, optional
        Called with the number of evaluations and the NLML after each evaluation.

    Returns
    -------
    model : GPModel
        The learned model.
    runs : sequence of Learned
        One for all classes, or one a class present: converged, iterations, NLML.

    Raises
    ------
    InputError
        No labels, or labels of a single class.
    """
    model = model or GPModel()
    labelled = cloud[cloud.labelled]
    training = training_set(model, labelled.points, labelled.class_weights)
    if len(training.present) < 2:
        raise InputError(
            "all labels are of one class: learning needs at least two. Give more labels, or a fixed model."
        )
    U = None
    if model.n_inducing is not None:
        U = inducing_points(training.X, model.n_inducing, model.inducing, model.seed)
    Y = binary_targets(training.weights)

    def run(columns: Array, start: int) -> Learned:
        m = np.array([model.mean(c) for c in training.present[columns]])
        return learn(
            lambda kernel: covariance(kernel, training.X, U),
            model.kernel(start),
            LIKELIHOODS[model.likelihood],
            Y[:, columns],
            m,
            bounds or Bounds(),
            prior,
            restarts,
            model.seed,
            max_iterations,
            progress,
        )

    P, C = len(training.present), len(cloud.classes)
    groups = np.arange(P)[:, None] if per_class else np.arange(P)[None]
    runs = [run(group, int(training.present[group[0]])) for group in groups]
    means = np.concatenate([r.m for r in runs])
    m = np.full(C, means.mean())  # classes not seen here get the mean of the others
    m[training.present] = means
    kernels = [runs[0].kernel] * C if per_class else [runs[0].kernel]
    if per_class:
        for c, r in zip(training.present, runs, strict=True):
            kernels[c] = r.kernel
    return replace(model, kernels=tuple(kernels), m=tuple(m.tolist())), runs
