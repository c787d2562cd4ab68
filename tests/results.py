"""Small tasks and results for the tests of figures and reports."""

from collections.abc import Sequence

import numpy as np

from semgp.baselines.csm import CSMMap
from semgp.baselines.knn import KNNMap
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.conventions import NYU13
from semgp.evaluation.task import Built, Method, Result, Task, run


def patches_task(name: str, experiment: str = "sparse", classes: Classes = NYU13, seed: int = 0) -> Task:
    """Return a wall of four patches before a camera, labels on half of it, and a strip that has no true label."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-1, 1, (600, 2)), np.full(600, 2.0)])
    labels = (points[:, 0] > 0) + 2 * (points[:, 1] > 0)
    truth = LabelledCloud(
        points,
        classes,
        labels=np.where(points[:, 0] > 0.9, -1, labels),
        colours=rng.integers(0, 256, (600, 3)).astype(np.uint8),
        T_world_sensor=np.eye(4),
    )
    given = np.where(points[:, 1] < 0.3, labels, -1)
    return Task(name, experiment, (LabelledCloud(points, classes, labels=given),), truth)


def _knn(task: Task) -> Built:
    return _updated(KNNMap(task.truth.classes, k=3, width=0.1), task)


def _octomap(task: Task) -> Built:
    return _updated(CSMMap(task.truth.classes, resolution=0.1), task)


def _updated(semantic_map: KNNMap | CSMMap, task: Task) -> Built:
    semantic_map.update(task.training[0])
    return Built(semantic_map, int(task.training[0].labelled.sum()))


METHODS: dict[str, Method] = {"octomap": _octomap, "knn": _knn}
"""One that leaves points unobserved, and one that does not."""


def results_of(*tasks: Task, methods: Sequence[str] = tuple(METHODS)) -> list[Result]:
    """Return the results of all methods on all tasks."""
    return [run(task, name, METHODS[name]) for task in tasks for name in methods]
