"""The rival maps, and clouds that they are made of."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.baselines.bki import BKIMap
from semgp.baselines.csm import CSMMap
from semgp.baselines.knn import KNNMap
from semgp.classes import Classes
from semgp.cloud import LabelledCloud

C = 4
CLASSES = Classes.numbered(C)
Rival = KNNMap | CSMMap | BKIMap
Maker = Callable[[], Rival]

# Resolutions are binary fractions, so that shifts by whole voxels are exact.
MAKERS: dict[str, Maker] = {
    "knn": lambda: KNNMap(CLASSES, k=5, width=0.1),
    "knn gauss": lambda: KNNMap(CLASSES, k=5, width=0.2, kernel="gauss", max_distance=0.25, alpha0=0.01),
    "csm": lambda: CSMMap(CLASSES, resolution=0.125),
    "csm prior": lambda: CSMMap(CLASSES, resolution=0.125, alpha0=0.001),
    "bki": lambda: BKIMap(CLASSES, resolution=0.125, ell=0.3),
}
every_rival = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())


def random_cloud(seed: int, n: int = 120, soft: bool = False) -> LabelledCloud:
    """Return points in a box around the origin, a fifth of them without label."""
    rng = np.random.default_rng(seed)
    points = rng.integers(-600, 600, (n, 3)) / 1024
    missing = rng.random(n) < 0.2
    if soft:
        weights = rng.dirichlet(np.full(C, 0.5), n).astype(np.float32)
        weights[missing] = 0
        return LabelledCloud(points, CLASSES, weights=weights)
    return LabelledCloud(points, CLASSES, labels=np.where(missing, -1, rng.integers(0, C, n)).astype(np.int32))


def queries(seed: int, m: int = 60) -> NDArray[np.float64]:
    return np.random.default_rng(seed).integers(-700, 700, (m, 3)) / 1024


def filled(make: Maker, *clouds: LabelledCloud) -> Rival:
    rival = make()
    for cloud in clouds:
        rival.update(cloud)
    return rival


def assert_same_answers(a: Rival, b: Rival, Qa: NDArray[np.float64], Qb: NDArray[np.float64]) -> None:
    pa, pb = a.query(Qa), b.query(Qb)
    np.testing.assert_array_equal(pa.observed, pb.observed)
    np.testing.assert_allclose(pa.probability, pb.probability, rtol=1e-4, atol=1e-6)
    if pa.variance is not None and pb.variance is not None:
        np.testing.assert_allclose(pa.variance, pb.variance, rtol=1e-4, atol=1e-7)
