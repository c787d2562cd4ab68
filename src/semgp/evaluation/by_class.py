"""Scores class by class: which classes a map gets right, and what it takes the others for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.evaluation.metrics import precision, recall
from semgp.evaluation.scores import Scores


@dataclass(frozen=True)
class ClassScores:
    """How well one class is told from the others.

    Parameters
    ----------
    name : str
        The class.
    points : int
        Points of this class in the truth; 0 for a class that is absent from it.
    given : int
        Points that were given this label, rightly or not.
    iou, recall : float
        Intersection over union, and share of its points that are labelled so; NaN for an absent class.
    precision : float
        Share of the points given this label that are of this class; NaN where there are none.
    auc : float
        One-vs-rest AUC; NaN for an absent class, and for one that all points belong to.
    probability : float
        Mean probability of this class at its own points; NaN for an absent class.
    not_observed : int
        Its points that the map has not observed: they count as missed.
    confused_with : str or None
        The other label that most of its points were given; None where none was given another.
    confused : int
        Points given that label.
    """

    name: str
    points: int
    given: int
    iou: float
    precision: float
    recall: float
    auc: float
    probability: float
    not_observed: int
    confused_with: str | None
    confused: int


def by_class(scores: Scores, classes: Classes) -> list[ClassScores]:
    """Return the scores of each class, in the order of the labels.

    Parameters
    ----------
    scores : Scores
        What `semgp.evaluation.scores.score` returned.
    classes : Classes
        The map's classes, C of them.

    Raises
    ------
    InputError
        Scores of another number of classes.
    """
    table = scores.confusion
    if len(table) != len(classes):
        raise InputError(f"scores of {len(table)} classes are not those of {len(classes)} classes.")
    exact, found = precision(table), recall(table)
    others = table[:, :-1] - np.diag(table.diagonal())
    rows = []
    for c, name in enumerate(classes.names):
        top = int(others[c].argmax())
        rows.append(
            ClassScores(
                name=name,
                points=int(table[c].sum()),
                given=int(table[:, c].sum()),
                iou=float(scores.iou[c]),
                precision=float(exact[c]),
                recall=float(found[c]),
                auc=float(scores.auc[c]),
                probability=float(scores.probability_of_truth[c]),
                not_observed=int(table[c, -1]),
                confused_with=classes.names[top] if others[c, top] else None,
                confused=int(others[c, top]),
            )
        )
    return rows
