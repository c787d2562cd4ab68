"""The paper's experiments on NYU Depth V2: sparse true labels, and the labels of a network.

Sparse: back-project every pixel, keep the labels on every third row and column ("downsampling by one-third"),
build the map from those, query every pixel that has a true label. Noisy: the labels of a segmentation network at
every pixel instead, wrong and spatially correlated. AUC is the mean over the classes present of the one-vs-rest
AUC (paper, eq. 10).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

from semgp.baselines.bki import BKIMap
from semgp.baselines.csm import CSMMap
from semgp.baselines.knn import KNNMap
from semgp.errors import InputError
from semgp.evaluation.measure import timed
from semgp.evaluation.task import Built, Method, Task, of_all
from semgp.gp.hyperparameters import Bounds
from semgp.gp.model import GPModel
from semgp.gp.stationary import Matern52
from semgp.maps.gp import GPSemanticMap
from semgp.maps.learning import learn_model
from semgp.maps.protocol import SemanticMap
from semgp.octomap import SemanticOctoMap
from semgp.readers import NYUFrame
from semgp.sampling import grid_stride, without_labels

EXPERIMENTS = ("sparse", "noisy")
STRIDE = 3
"""Rows and columns between kept labels in the sparse experiment."""
PAPER_FRAMES = (282, 374, 555, 965)
SETTINGS: Mapping[str, tuple[GPModel, Bounds]] = {
    "sparse": (
        GPModel(kernels=(Matern52(ell=(0.5, 0.5, 0.5), sf=5.0),), inducing="farthest"),
        Bounds(ell=(0.02, 10), sf=(0.1, 100)),
    ),
    "noisy": (
        GPModel(kernels=(Matern52(ell=(0.35, 0.35, 0.35), sf=0.3),), inducing="farthest"),
        Bounds(ell=(0.35, 0.35), sf=(0.3, 0.3)),
    ),
}
"""Start and bounds of learning, chosen on eight other frames.

A network's errors are correlated in space and the evidence takes them for signal: left free, it learns signal
deviations of 20 to 60 and repeats every mistake. For noisy labels only the means are learned, therefore.
"""
LEARNING_INDUCING, INDUCING = 300, 600
"""Inducing points while learning, which needs many posteriors, and for the map, which needs one."""
LEARNING_STEPS = 22
"""Limit of learning steps: eight more move the default rule's scores by a thousandth at most."""


def nyu_task(frame: NYUFrame, experiment: str, soft: bool = False, seed: int = 0) -> Task:
    """Return the task of one frame.

    Parameters
    ----------
    frame : NYUFrame
        The frame, with the class list that is to be scored.
    experiment : {"sparse", "noisy"}
        True labels on a grid, or a network's labels.
    soft : bool, optional
        The network's class probabilities instead of its hard labels; noisy experiment only.
    seed : int, optional
        Seed of the small training set.

    Raises
    ------
    InputError
        An unknown experiment, or soft labels where there are none.
    """
    if experiment not in EXPERIMENTS:
        raise InputError(f"the experiment must be one of {', '.join(EXPERIMENTS)}, not {experiment!r}.")
    if soft and experiment != "noisy":
        raise InputError("soft labels belong to the noisy experiment: the true labels have no probabilities.")
    truth = frame.cloud
    if experiment == "sparse":
        training = without_labels(truth, grid_stride(truth, STRIDE))
    elif soft:
        training = replace(truth, labels=None, weights=frame.network_probability)
    else:
        training = replace(truth, labels=frame.network_labels)
    name = f"{experiment}-soft" if soft else experiment
    return Task(f"{frame.number}", name, (training,), truth, seed=seed)


@lru_cache(maxsize=1)
def _learned(task: Task) -> tuple[GPModel, float]:
    """Return the model learned from a task's small training set, and the seconds that took."""
    model, bounds = SETTINGS[task.experiment.removesuffix("-soft")]
    start = replace(model, seed=task.seed, n_inducing=LEARNING_INDUCING)
    return timed(lambda: learn_model(task.small, start, bounds=bounds, max_iterations=LEARNING_STEPS)[0])


def _gpsm(task: Task, rule: str) -> Built:
    """The paper's GP semantic map, its hyperparameters learned from the frame's own labels."""
    learned, learning_seconds = _learned(task)
    gp_map = GPSemanticMap(task.small.classes, replace(learned, rule=rule, n_inducing=INDUCING))
    gp_map.update(task.small)
    _, seconds = timed(gp_map.solve)
    return Built(gp_map, len(task.small), learning_seconds + seconds)


def _of_small(semantic_map: SemanticMap, task: Task) -> Built:
    """A map of the points that the GP gets."""
    semantic_map.update(task.small)
    return Built(semantic_map, len(task.small))


def _knn_256(task: Task) -> Built:
    """Many neighbours of every seventh labelled point: the strongest vote on network labels."""
    thinned = [cloud[cloud.labelled][::7] for cloud in task.training]
    return of_all(KNNMap(task.truth.classes, k=256, width=0.05), replace(task, training=tuple(thinned)))


METHODS: Mapping[str, Method] = {
    "gpsm": lambda task: _gpsm(task, "softmax"),
    "gpsm-averaged": lambda task: _gpsm(task, "averaged"),
    "knn": lambda task: _of_small(KNNMap(task.truth.classes, k=8, width=0.02), task),
    "knn-all": lambda task: of_all(KNNMap(task.truth.classes, k=8, width=0.02), task),
    "1nn-all": lambda task: of_all(KNNMap(task.truth.classes, k=1), task),
    "knn-256": _knn_256,
    "octomap": lambda task: of_all(SemanticOctoMap(task.truth.classes, resolution=0.02), task),
    "csm": lambda task: of_all(CSMMap(task.truth.classes, resolution=0.02), task),
    "bki": lambda task: of_all(BKIMap(task.truth.classes, resolution=0.02, ell=0.1), task),
}
"""The methods by name."""
