"""The demo: one scan of the synthetic room, the GP map and its rivals, and the pictures to look at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from semgp.baselines.bki import BKIMap
from semgp.baselines.knn import KNNMap
from semgp.evaluation.task import Built, Method, Task, of_all
from semgp.gp.hyperparameters import Bounds
from semgp.gp.model import GPModel
from semgp.maps.gp import GPSemanticMap
from semgp.maps.learning import learn_model
from semgp.maps.presets import GENERAL
from semgp.octomap import SemanticOctoMap
from semgp.picture.colour import by_class, by_value
from semgp.picture.compose import colour_bar, legend, panels, stack
from semgp.picture.splat import disc_sizes, splat
from semgp.picture.view import view_of
from semgp.prediction import Prediction
from semgp.scene.scan import SyntheticScan, synthetic_room

MODEL = GPModel(max_points=2000, n_inducing=150, inducing="farthest")
"""Smaller than the paper's, to stay quick."""
BOUNDS = Bounds(ell=(0.05, 5), sf=(0.1, 10))


def demo_task(seed: int) -> tuple[SyntheticScan, Task]:
    """Return a scan of the room, and the task to map it from its observed labels."""
    scan = synthetic_room(seed).scan(0)
    return scan, Task("room", "sparse and noisy", (scan.observed,), scan.truth, MODEL.max_points, seed)


def _blocks(task: Task) -> Built:
    gp_map = GPSemanticMap(task.truth.classes, GENERAL)
    built = of_all(gp_map, task)
    gp_map.solve()
    return built


def _paper(task: Task) -> Built:
    model, _ = learn_model(task.small, replace(MODEL, seed=task.seed), bounds=BOUNDS, max_iterations=8)
    gp_map = GPSemanticMap(task.truth.classes, model)
    gp_map.update(task.small)
    gp_map.solve()
    return Built(gp_map, len(task.small))


METHODS: Mapping[str, Method] = {
    "GP map": _blocks,
    "the paper's": _paper,
    "k-NN": lambda task: of_all(KNNMap(task.truth.classes), task),
    "OctoMap": lambda task: of_all(SemanticOctoMap(task.truth.classes, resolution=0.1), task),
    "BKI": lambda task: of_all(BKIMap(task.truth.classes, resolution=0.05, ell=0.15), task),
}
"""The methods by name, the GP first."""


def warm_up(task: Task) -> None:
    """Run the rivals and the drawing on a few points, so that compilation is not timed with the real ones."""
    few = replace(task, training=(task.training[0][::500],), truth=task.truth[::500])
    for name in list(METHODS)[1:]:
        METHODS[name](few).semantic_map.query(few.truth.points)
    points = few.truth.points
    splat(points, by_class(few.truth.hard_labels, few.truth.classes), view_of(points, few.truth.origin))


def demo_pictures(scan: SyntheticScan, prediction: Prediction) -> dict[str, NDArray[np.uint8]]:
    """Return the pictures by name: truth, input, GP map, its uncertainty, and all four as one overview."""
    points, classes = scan.truth.points, scan.truth.classes
    view = view_of(points, scan.truth.origin, width=800, height=600)
    size = disc_sizes(points)
    most = float(np.log(len(classes)))
    colours = {
        "truth": by_class(scan.truth.hard_labels, classes),
        "input": by_class(scan.observed.hard_labels, classes),
        "gp-map": by_class(prediction.label, classes),
        "uncertainty": by_value(prediction.entropy, 0.0, most),
    }
    sizes = {"input": size * np.where(scan.observed.labelled, 1.4, 1.0)}
    pictures = {name: splat(points, colour, view, sizes.get(name, size)) for name, colour in colours.items()}
    titles = ("truth", "input: sparse, missing and wrong labels", "GP map", "its uncertainty (entropy)")
    grid = panels(list(pictures.values()), titles, columns=2)
    bar = colour_bar(0.0, most, "entropy in nats")
    names = legend(classes, grid.shape[1], missing="no label")
    return pictures | {"overview": stack([grid, names, bar])}
