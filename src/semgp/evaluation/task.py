"""A task: labels to build a map from, points to ask it about, and the truth to score it by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.evaluation.measure import peak_memory_mb, reset_peak_memory, timed
from semgp.evaluation.scores import Scores, score
from semgp.maps.gp import GPSemanticMap
from semgp.maps.protocol import SemanticMap
from semgp.prediction import Prediction
from semgp.sampling import random_subset


@dataclass(frozen=True, eq=False)
class Task:
    """One scene of an experiment.

    Parameters
    ----------
    name : str
        Frame number, or what else tells the scene apart.
    experiment : str
        Which labels the map is built from.
    training : tuple of LabelledCloud
        Scans with the labels that a map may use.
    truth : LabelledCloud
        Query points with their true labels.
    n_small : int
        Points of the small training set, for methods that cannot take them all.
    seed : int
        Seed of that set and of all that the methods draw.
    """

    name: str
    experiment: str
    training: tuple[LabelledCloud, ...]
    truth: LabelledCloud
    n_small: int = 5000
    seed: int = 0

    @cached_property
    def small(self) -> LabelledCloud:
        """At most `n_small` labelled points of the first scan, drawn with the seed."""
        labelled = self.training[0][self.training[0].labelled]
        return labelled[random_subset(labelled, self.n_small, self.seed)]


@dataclass(frozen=True)
class Built:
    """A map that is up to date.

    Parameters
    ----------
    semantic_map : SemanticMap
        The map.
    n_train : int
        Labelled points that it was built from.
    fit_seconds : float, optional
        Seconds that building it takes, where some of the work was done before for another method.
    learn_seconds : float, optional
        Seconds that learning its settings took, where that is not a part of building it.
    """

    semantic_map: SemanticMap
    n_train: int
    fit_seconds: float | None = None
    learn_seconds: float = 0.0


def of_all(semantic_map: SemanticMap, task: Task) -> Built:
    """Update a map with every scan of a task."""
    for cloud in task.training:
        semantic_map.update(cloud)
    return Built(semantic_map, sum(int(cloud.labelled.sum()) for cloud in task.training))


def of_all_solved(gp_map: GPSemanticMap, task: Task, learn_seconds: float) -> Built:
    """Update a GP map with every scan of a task and solve it; its model took `learn_seconds` to learn."""
    built, fit_seconds = timed(lambda: of_all(gp_map, task))
    _, solve_seconds = timed(gp_map.solve)
    return replace(built, fit_seconds=fit_seconds + solve_seconds, learn_seconds=learn_seconds)


Method = Callable[[Task], Built]
"""Builds a method's map for a task."""


@dataclass(frozen=True, eq=False)
class Result:
    """One method's answer to one task: a row of the table, and what figures are made of.

    Prediction and map may be let go (None) once the figures are drawn.
    """

    frame: str
    method: str
    experiment: str
    scores: Scores
    prediction: Prediction | None
    semantic_map: SemanticMap | None
    n_train: int
    fit_seconds: float
    query_seconds: float
    peak_rss_mb: float
    learn_seconds: float = 0.0

    def row(self) -> dict[str, Any]:
        """Return the row, ready for JSON; all scores are fractions from 0 to 1 but the NLL, in nats."""
        s = self.scores
        return {
            "frame": self.frame,
            "method": self.method,
            "experiment": self.experiment,
            **{"auc": s.auc_total, "accuracy": s.accuracy, "miou": s.miou, "nll": s.nll, "ece": s.ece},
            "coverage": s.coverage,
            "n_train": self.n_train,
            "n_query": s.n_points,
            "n_classes": int(np.isfinite(s.auc).sum()),
            "fit_seconds": round(self.fit_seconds, 3),
            "query_seconds": round(self.query_seconds, 3),
            "learn_seconds": round(self.learn_seconds, 3),
            "peak_rss_mb": round(self.peak_rss_mb, 1),
            "scores": s.to_json(),
        }


def run(task: Task, name: str, method: Method) -> Result:
    """Build a method's map, query it at every truly labelled point, and score it."""
    truth = task.truth[task.truth.hard_labels != MISSING]
    reset_peak_memory()
    built, fit_seconds = timed(lambda: method(task))
    prediction, query_seconds = timed(lambda: built.semantic_map.query(truth.points))
    peak = peak_memory_mb()
    scores = score(prediction.probability, prediction.observed, truth.hard_labels)
    return Result(
        frame=task.name,
        method=name,
        experiment=task.experiment,
        scores=scores,
        prediction=prediction,
        semantic_map=built.semantic_map,
        n_train=built.n_train,
        fit_seconds=fit_seconds if built.fit_seconds is None else built.fit_seconds,
        query_seconds=query_seconds,
        peak_rss_mb=peak,
        learn_seconds=built.learn_seconds,
    )
