"""The rival maps against naive loops, and on a real frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.baselines.bki import BKIMap
from semgp.baselines.csm import CSMMap
from semgp.baselines.knn import KNNMap
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.evaluation.scores import score
from semgp.readers.nyu import NYUFolder
from tests import naive
from tests.baselines.rivals import CLASSES, MAKERS, C, Rival, filled, queries, random_cloud


def mass_of(cloud: LabelledCloud) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the labelled points and their class mass, written out here on purpose."""
    keep = cloud.labelled
    if cloud.weights is not None:
        return cloud.points[keep], cloud.weights[keep].astype(float)
    assert cloud.labels is not None
    return cloud.points[keep], np.eye(C)[cloud.labels[keep]]


@given(st.integers(0, 2**32), st.booleans(), st.sampled_from(["exp", "gauss"]))
@settings(max_examples=20, deadline=None)
def test_knn_equals_naive(seed: int, soft: bool, kernel: str) -> None:
    cloud = random_cloud(seed, soft=soft)
    # No two distances shall be equal.
    jittered = cloud.points + np.random.default_rng(seed).normal(0, 1e-4, cloud.points.shape)
    cloud = LabelledCloud(jittered, CLASSES, cloud.labels, cloud.weights)
    rival = KNNMap(CLASSES, k=6, width=0.1, kernel="exp" if kernel == "exp" else "gauss")
    rival.update(cloud)
    expected = naive.knn(*mass_of(cloud), queries(seed), k=6, width=0.1, kernel=kernel)
    np.testing.assert_allclose(rival.query(queries(seed)).probability, expected, rtol=1e-4, atol=1e-6)


@given(st.integers(0, 2**32), st.booleans())
@settings(max_examples=20, deadline=None)
def test_csm_equals_naive(seed: int, soft: bool) -> None:
    cloud = random_cloud(seed, soft=soft)
    rival = filled(MAKERS["csm"], cloud)
    mass = naive.csm(*mass_of(cloud), queries(seed), resolution=0.125)
    total = mass.sum(axis=1, keepdims=True)
    answer = rival.query(queries(seed))
    np.testing.assert_array_equal(answer.observed, total[:, 0] > 0)
    expected = np.where(total > 0, mass / np.maximum(total, 1e-30), 1 / C)
    np.testing.assert_allclose(answer.probability, expected, rtol=1e-5, atol=1e-7)


@given(st.integers(0, 2**32), st.booleans(), st.sampled_from([0.05, 0.125, 0.3]))
@settings(max_examples=20, deadline=None)
def test_bki_equals_naive(seed: int, soft: bool, resolution: float) -> None:
    cloud = random_cloud(seed, n=40, soft=soft)
    rival = BKIMap(CLASSES, resolution, ell=0.2, sigma0=2.0, alpha0=0.01)
    rival.update(cloud)
    alpha = naive.bki(*mass_of(cloud), queries(seed), resolution, ell=0.2, sigma0=2.0) + 0.01
    total = alpha.sum(axis=1, keepdims=True)
    mean = alpha / total
    answer = rival.query(queries(seed))
    assert answer.mean is not None
    assert answer.variance is not None
    np.testing.assert_allclose(answer.probability, mean, rtol=1e-3, atol=2e-5)
    np.testing.assert_array_equal(answer.mean, answer.probability)
    np.testing.assert_allclose(answer.variance, mean * (1 - mean) / (total + 1), rtol=1e-3, atol=2e-5)
    np.testing.assert_array_equal(answer.observed[total[:, 0] > C * 0.01 + 1e-4], True)
    np.testing.assert_array_equal(answer.observed[total[:, 0] == C * 0.01], False)


def test_fewer_points_than_neighbours_all_vote() -> None:
    rival = KNNMap(CLASSES, k=50)
    rival.update(LabelledCloud(np.eye(3), CLASSES, labels=np.array([0, 1, 1], np.int32)))
    np.testing.assert_allclose(rival.query([[0, 0, 0]]).probability, [[1 / 3, 2 / 3, 0, 0]], rtol=1e-6)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda classes: CSMMap(classes, 0.02), 0.8816),
        (lambda classes: KNNMap(classes, k=1), 0.992),
        (lambda classes: KNNMap(classes, k=8, width=0.02), 0.9994),
    ],
    ids=["csm", "1-nn", "8-nn"],
)
def test_sparse_labels_of_a_real_frame(data_dir: Path, make: Callable[[Classes], Rival], expected: float) -> None:
    """AUC_total of frame 282 from every third row and column, as measured for the paper's protocol."""
    frame = NYUFolder(data_dir / "nyu").read(282).cloud
    truth = frame[frame.labelled]
    rival = make(truth.classes)
    rival.update(truth[(np.asarray(truth.pixels) % 3 == 0).all(axis=1)])
    answer = rival.query(truth.points)
    scores = score(answer.probability, answer.observed, truth.hard_labels)
    assert scores.auc_total == pytest.approx(expected, abs=5e-4)
