"""Annotators whose errors are known, and the scans that they label."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud

FOUR = Classes(("road", "grass", "wall", "tree"))
RESOLUTION = 0.25
CONFUSION = np.array([[0.85, 0.1, 0.05, 0], [0.2, 0.7, 0.02, 0.08], [0, 0.05, 0.9, 0.05], [0.02, 0.18, 0.2, 0.6]])
FREQUENCIES = np.array([0.4, 0.3, 0.2, 0.1])
F64 = NDArray[np.float64]


def pose(origin: ArrayLike) -> F64:
    T = np.eye(4)
    T[:3, 3] = origin
    return T


def halved(rows: list[int], n: int = 3) -> NDArray[np.float32]:
    """Confidences of one but for some rows, of a half."""
    confidence = np.ones(n, dtype=np.float32)
    confidence[rows] = 0.5
    return confidence


def random_scans(seed: int, n: int = 3, points: int = 60, extent: float = 0.8) -> list[LabelledCloud]:
    """Scans of a few voxels, many labels a voxel, some missing, each with a confidence."""
    rng = np.random.default_rng(seed)
    return [
        LabelledCloud(
            rng.uniform(-extent, extent, (points, 3)), FOUR, rng.integers(MISSING, 4, points, dtype=np.int32),
            confidence=rng.choice([0.0, 0.25, 1.0], points), T_world_sensor=pose(rng.uniform(-3, 3, 3)),
        )
        for _ in range(n)
    ]  # fmt: skip


def annotated(
    said: Callable[[NDArray[np.int64], LabelledCloud, np.random.Generator], NDArray[np.int64]],
    scans: int = 5, voxels: int = 10_000, extent: float = 100.0,
) -> list[LabelledCloud]:  # fmt: skip
    """Scans that each see most of the same voxels, once or twice, and say the same thing twice."""
    rng = np.random.default_rng(0)
    cells = np.unique(rng.integers(0, int(extent / RESOLUTION), (voxels, 2)), axis=0)
    truth = rng.choice(4, len(cells), p=FREQUENCIES)
    clouds = []
    for i in range(scans):
        seen = rng.random(len(cells)) < 0.8
        middle = (np.column_stack([cells[seen], np.zeros(seen.sum())]) + 0.5) * RESOLUTION
        cloud = LabelledCloud(middle, FOUR, T_world_sensor=pose((extent * i / scans, extent / 3, 1.5)))
        labels = said(truth[seen], cloud, rng)
        twice = rng.integers(1, 3, len(middle))
        jitter = rng.uniform(-0.1, 0.1, (twice.sum(), 3))
        clouds.append(
            replace(
                cloud, points=middle.repeat(twice, axis=0) + jitter, labels=labels.astype(np.int32).repeat(twice)
            )
        )
    return clouds


def by_confusion(truth: NDArray[np.int64], cloud: LabelledCloud, rng: np.random.Generator) -> NDArray[np.int64]:
    return np.asarray((rng.random((len(truth), 1)) > CONFUSION[truth].cumsum(axis=1)).sum(axis=1))
