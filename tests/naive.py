"""Naive reference loops: each says what it computes in the fewest words, and is far too slow to use."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Labels = NDArray[np.int64]


def auc(positive: Array, negative: Array) -> float:
    """Share of pairs in which the positive one scores higher; a tie counts one half."""
    won = sum((p > n) + 0.5 * (p == n) for p in positive for n in negative)
    return float(won / (len(positive) * len(negative)))


def one_vs_rest_auc(score: Array, truth: Labels) -> Array:
    n_classes = score.shape[1]
    score, truth = score[truth >= 0], truth[truth >= 0]
    return np.array(
        [
            auc(score[truth == c, c], score[truth != c, c]) if 0 < (truth == c).sum() < len(truth) else math.nan
            for c in range(n_classes)
        ]
    )


def hand_till_auc(score: Array, truth: Labels) -> float:
    present = [c for c in range(score.shape[1]) if (truth == c).any()]
    pairs = [
        (auc(score[truth == i, i], score[truth == j, i]) + auc(score[truth == j, j], score[truth == i, j])) / 2
        for i in present
        for j in present
        if i < j
    ]
    return sum(pairs) / len(pairs)


def ece(probability: Array, truth: Labels, bins: int) -> float:
    total = 0.0
    for b in range(bins):
        low, high = b / bins, (b + 1) / bins
        inside = [
            (p.max(), float(p.argmax() == y))
            for p, y in zip(probability, truth)
            if low < p.max() <= high and y >= 0
        ]
        if inside:
            confidence, right = np.mean(inside, axis=0)
            total += len(inside) / (truth >= 0).sum() * abs(confidence - right)
    return total


def knn(X: Array, mass: Array, query: Array, k: int, width: float, kernel: str) -> Array:
    rows = []
    for q in query:
        distance = [math.dist(q, x) for x in X]
        vote = np.zeros(mass.shape[1])
        for i in sorted(range(len(X)), key=distance.__getitem__)[:k]:
            d = distance[i] / width
            vote += mass[i] * math.exp(-d if kernel == "exp" else -(d**2) / 2)
        rows.append(vote / vote.sum())
    return np.array(rows)


def csm(X: Array, mass: Array, query: Array, resolution: float) -> Array:
    """Mass in the voxel of each query; not normalised."""
    rows = []
    for q in query:
        total = np.zeros(mass.shape[1])
        for x, m in zip(X, mass):
            if all(math.floor(a / resolution) == math.floor(b / resolution) for a, b in zip(x, q)):
                total += m
        rows.append(total)
    return np.array(rows)


def bki(X: Array, mass: Array, query: Array, resolution: float, ell: float, sigma0: float) -> Array:
    """Kernel-weighted mass at the centre of each query's voxel; without the prior."""
    rows = []
    for q in query:
        centre = [(math.floor(a / resolution) + 0.5) * resolution for a in q]
        total = np.zeros(mass.shape[1])
        for x, m in zip(X, mass):
            r = math.dist(x, centre) / ell
            if r < 1:
                smooth = (2 + math.cos(2 * math.pi * r)) / 3 * (1 - r)
                total += sigma0 * (smooth + math.sin(2 * math.pi * r) / (2 * math.pi)) * m
        rows.append(total)
    return np.array(rows)
