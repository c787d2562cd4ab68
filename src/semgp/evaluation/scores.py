"""All metrics of one prediction: the row that an experiment's table shows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.evaluation.auc import hand_till, mean_of_known, one_vs_rest, pair_wins
from semgp.evaluation.calibration import Reliability, brier, nll, probability_of_truth, reliability
from semgp.evaluation.checks import probabilities
from semgp.evaluation.metrics import accuracy, confusion, iou


@dataclass(frozen=True, eq=False)
class Scores:
    """Metrics of class probabilities against the truth.

    Parameters
    ----------
    n_points : int
        Points whose truth is known.
    coverage : float
        Share of them that the map has observed.
    auc : (C,) array
        One-vs-rest AUC of each class; NaN for absent classes.
    auc_total : float
        Mean of `auc` over the classes present (equation 10 of the paper).
    auc_hand_till : float
        Multi-class AUC of Hand and Till (2001).
    accuracy : float
        Share of right labels.
    iou : (C,) array
        Intersection over union of each class; NaN for absent classes.
    miou : float
        Mean of `iou` over the classes present.
    confusion : (C, C + 1) integer array
        Points by true class (row) and label given (column); in the last column those not observed.
    probability_of_truth : (C,) array
        Mean probability of each class at its own points; NaN for absent classes.
    nll : float
        Mean log-loss in nats, probabilities floored at 1e-6.
    brier : float
        Mean multi-class Brier score, 0 to 2.
    ece : float
        Expected calibration error, 15 bins.
    reliability : Reliability
        The diagram behind `ece`.
    on_observed : Scores or None
        The same metrics over the observed points alone; None where nothing was observed, and inside itself.
    """

    n_points: int
    coverage: float
    auc: NDArray[np.float64]
    auc_total: float
    auc_hand_till: float
    accuracy: float
    iou: NDArray[np.float64]
    miou: float
    confusion: NDArray[np.int64]
    probability_of_truth: NDArray[np.float64]
    nll: float
    brier: float
    ece: float
    reliability: Reliability
    on_observed: Scores | None = None

    def to_json(self) -> dict[str, Any]:
        """Return all but confusion, `probability_of_truth` and diagram as numbers, lists and None (for NaN)."""
        plain: dict[str, Any] = {"n_points": self.n_points}
        for name in ("coverage", "auc_total", "auc_hand_till", "accuracy", "miou", "nll", "brier", "ece"):
            plain[name] = _number(getattr(self, name))
        plain["auc"] = [_number(v) for v in self.auc]
        plain["iou"] = [_number(v) for v in self.iou]
        plain["on_observed"] = self.on_observed.to_json() if self.on_observed else None
        return plain


def score(probability: ArrayLike, observed: ArrayLike, truth: ArrayLike) -> Scores:
    """Score class probabilities over all points whose truth is known, and over the observed ones alone.

    Over all points, one that the map has not observed scores zero for every class: it ranks last in each
    AUC, its label is wrong, its log-loss is -log(1e-6), its Brier score 1, its confidence zero.

    Parameters
    ----------
    probability : (N, C) array
        Class probabilities, float32 or float64.
    observed : (N,) bool array
        Where the map has data that speak of the point (`Prediction.observed`).
    truth : (N,) integer array
        True labels; points without one (`MISSING`) are left out.

    Raises
    ------
    InputError
        Arrays that do not fit, probabilities outside of 0 to 1, or no point whose truth is known.
    """
    seen = np.asarray(observed)
    if seen.dtype != np.bool_ or seen.shape != np.shape(truth):
        raise InputError(f"observed must be bool of shape {np.shape(truth)}, not {seen.dtype} of {seen.shape}.")
    p, y = probabilities(probability, truth)
    if not len(y):
        raise InputError("there is nothing to score: no point has a true label.")
    seen = seen[np.asarray(truth) != MISSING]
    on_observed = _scores(p[seen], seen[seen], y[seen]) if seen.any() else None
    over_all = on_observed if on_observed and seen.all() else _scores(np.where(seen[:, None], p, 0), seen, y)
    return replace(over_all, on_observed=on_observed)


def _scores(p: NDArray[np.floating], seen: NDArray[np.bool_], y: NDArray[np.int64]) -> Scores:
    """Score points whose truth is known and whose rows are zero where not observed."""
    wins, count = pair_wins(p, y)
    auc = one_vs_rest(wins, count)
    table = confusion(np.where(seen, p.argmax(axis=1), MISSING), y, p.shape[1])
    overlap = iou(table)
    diagram = reliability(p, y)
    return Scores(
        n_points=len(y),
        coverage=float(seen.mean()),
        auc=auc,
        auc_total=mean_of_known(auc),
        auc_hand_till=hand_till(wins, count),
        accuracy=accuracy(table),
        iou=overlap,
        miou=mean_of_known(overlap),
        confusion=table,
        probability_of_truth=probability_of_truth(p, y),
        nll=nll(p, y),
        brier=brier(p, y),
        ece=diagram.ece,
        reliability=diagram,
    )


def _number(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
