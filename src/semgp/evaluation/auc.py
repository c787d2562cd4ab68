"""Area under the ROC curve for many classes, exact under ties."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from semgp.evaluation.checks import scored_points
from semgp.parallel import parallel_map


def one_vs_rest_auc(score: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """Return the AUC (C,) of each class against all others: the Mann-Whitney statistic with mid-ranks.

    Parameters
    ----------
    score : (N, C) array
        Column c ranks the points by how much they look like class c.
    truth : (N,) integer array
        True labels; points without one (`MISSING`) are left out.

    Returns
    -------
    (C,) array
        NaN for classes without points, and for a class that all points belong to.

    Raises
    ------
    InputError
        Shapes that do not agree, labels out of range, or scores that are NaN.
    """
    return one_vs_rest(*pair_wins(score, truth))


def auc_total(score: ArrayLike, truth: ArrayLike) -> float:
    """Return the mean of `one_vs_rest_auc` over the classes present: AUC_total, equation 10 of the paper.

    Source: Ghaffari Jadidi et al. (2017), "Gaussian Processes Semantic Map Representation". NaN where no
    class has an AUC.
    """
    return mean_of_known(one_vs_rest_auc(score, truth))


def hand_till_auc(score: ArrayLike, truth: ArrayLike) -> float:
    """Return Hand and Till's M: the mean of A(i, j) = (A(i|j) + A(j|i)) / 2 over pairs of classes present.

    A(i|j) is the probability that a random point of class i scores higher for class i than a random point
    of class j. NaN with fewer than two classes present. Parameters and errors as `one_vs_rest_auc`.

    Source: Hand and Till (2001), "A Simple Generalisation of the Area Under the ROC Curve for Multiple Class
    Classification Problems".
    """
    return hand_till(*pair_wins(score, truth))


def pair_wins(score: ArrayLike, truth: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Count the pairs of points that each class's score puts in the right order.

    Returns
    -------
    wins : (C, C) array
        Entry (i, j): pairs of a point of class i and a point of class j in which the former has the higher
        score for class i; a tie counts one half. Exact. The diagonal means nothing.
    count : (C,) integer array
        Points of each class.
    """
    S, y = scored_points(score, truth)
    n_classes = S.shape[1]
    count = np.bincount(y, minlength=n_classes)

    def wins_of(c: int) -> NDArray[np.float64]:
        if count[c] == 0:
            return np.zeros(n_classes)
        column = np.ascontiguousarray(S[:, c])
        order = np.argsort(column)
        return np.asarray(_wins(column[order], y[order], c, n_classes))

    return np.array(parallel_map(wins_of, range(n_classes))), count


def one_vs_rest(wins: NDArray[np.float64], count: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the AUC (C,) of each class against all others, from `pair_wins`."""
    pairs = count * (count.sum() - count)
    won = wins.sum(axis=1) - wins.diagonal()
    return np.asarray(np.divide(won, pairs, out=np.full(len(count), np.nan), where=pairs > 0))


def hand_till(wins: NDArray[np.float64], count: NDArray[np.int64]) -> float:
    """Return Hand and Till's M from `pair_wins`."""
    present = np.flatnonzero(count)
    if len(present) < 2:
        return float("nan")
    A = wins[np.ix_(present, present)] / np.outer(count[present], count[present])
    return float(A[~np.eye(len(present), dtype=bool)].mean())


def mean_of_known(values: NDArray[np.float64]) -> float:
    """Return the mean of the values that are not NaN; NaN if there is none."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else float("nan")


@njit(cache=True, nogil=True)
def _wins(score: NDArray[np.floating], truth: NDArray[np.int64], c: int, n_classes: int) -> NDArray[np.float64]:
    """Walk up the sorted scores, one group of equal scores at a time."""
    wins = np.zeros(n_classes)
    below = np.zeros(n_classes, dtype=np.int64)
    here = np.zeros(n_classes, dtype=np.int64)
    start = 0
    while start < len(score):
        stop = start
        here[:] = 0
        while stop < len(score) and score[stop] == score[start]:
            here[truth[stop]] += 1
            stop += 1
        if here[c] > 0:
            for j in range(n_classes):
                wins[j] += here[c] * (below[j] + 0.5 * here[j])
        below += here
        start = stop
    return wins
