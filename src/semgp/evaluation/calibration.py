"""How far probabilities can be believed: log-loss, Brier score, calibration error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.errors import InputError
from semgp.evaluation.checks import probabilities

FLOOR = 1e-6
"""Least probability that the log-loss takes, so that one answer of zero costs 13.8 nats and not infinity."""


@dataclass(frozen=True, eq=False)
class Reliability:
    """The reliability diagram: how often the most probable class was right, by its probability.

    Parameters
    ----------
    edges : (B + 1,) array
        Borders of the bins; bin b holds confidences above edges[b], up to and with edges[b + 1].
    count : (B,) integer array
        Points in each bin.
    confidence, accuracy : (B,) array
        Mean confidence, and share of right answers, of each bin; NaN in empty bins.
    """

    edges: NDArray[np.float64]
    count: NDArray[np.int64]
    confidence: NDArray[np.float64]
    accuracy: NDArray[np.float64]

    @property
    def ece(self) -> float:
        """Expected calibration error: the mean of |accuracy - confidence| over points; NaN without points."""
        filled = self.count > 0
        if not filled.any():
            return float("nan")
        gap = np.abs(self.accuracy - self.confidence)[filled]
        return float(np.average(gap, weights=self.count[filled]))


def reliability(probability: ArrayLike, truth: ArrayLike, bins: int = 15) -> Reliability:
    """Return the reliability diagram with `bins` bins of equal width.

    Source: Guo et al. (2017), "On Calibration of Modern Neural Networks".

    Parameters
    ----------
    probability : (N, C) array
        Class probabilities. A row of zeros is an answer withheld: confidence zero, and wrong.
    truth : (N,) integer array
        True labels; points without one (`MISSING`) are left out.
    bins : int, optional
        Number of bins between 0 and 1.

    Raises
    ------
    InputError
        Arrays that do not fit, probabilities outside of 0 to 1, or fewer than one bin.
    """
    if bins < 1:
        raise InputError(f"a reliability diagram needs at least one bin, not {bins}.")
    p, y = probabilities(probability, truth)
    confidence = p.max(axis=1).astype(np.float64)
    right = (p.argmax(axis=1) == y) & (confidence > 0)
    at = np.clip(np.ceil(confidence * bins).astype(np.int64) - 1, 0, bins - 1)
    count = np.bincount(at, minlength=bins)

    def bin_mean(values: NDArray[np.generic]) -> NDArray[np.float64]:
        total = np.bincount(at, weights=values, minlength=bins)
        return np.asarray(np.divide(total, count, out=np.full(bins, np.nan), where=count > 0))

    return Reliability(np.linspace(0, 1, bins + 1), count, bin_mean(confidence), bin_mean(right))


def ece(probability: ArrayLike, truth: ArrayLike, bins: int = 15) -> float:
    """Return the expected calibration error; parameters and errors as `reliability`."""
    return reliability(probability, truth, bins).ece


def nll(probability: ArrayLike, truth: ArrayLike) -> float:
    """Return the mean of -log p(true class), in nats, with p raised to `FLOOR` where it is smaller.

    NaN without points; parameters and errors as `reliability`.
    """
    p, y = probabilities(probability, truth)
    p_true = p[np.arange(len(y)), y].astype(np.float64)
    return float(-np.log(np.maximum(p_true, FLOOR)).mean()) if len(y) else float("nan")


def probability_of_truth(probability: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """Return the mean probability (C,) that each class has at its own points; NaN for absent classes.

    Parameters and errors as `reliability`.
    """
    p, y = probabilities(probability, truth)
    count = np.bincount(y, minlength=p.shape[1])
    total = np.bincount(y, weights=p[np.arange(len(y)), y], minlength=p.shape[1])
    return np.asarray(np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0))


def brier(probability: ArrayLike, truth: ArrayLike) -> float:
    """Return the mean of sum_c (p_c - y_c)^2, with y the true class as a one-hot vector: from 0 to 2.

    NaN without points; parameters and errors as `reliability`.
    """
    p, y = probabilities(probability, truth)
    if not len(y):
        return float("nan")
    p_true = p[np.arange(len(y)), y].astype(np.float64)
    return float((np.einsum("nc,nc->n", p, p, dtype=np.float64) - 2 * p_true + 1).mean())
