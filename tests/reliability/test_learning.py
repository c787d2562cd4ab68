"""Known annotators are found again, and nothing is made of perfect labels."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.cloud import LabelledCloud
from semgp.readers import SemanticKITTISequence
from semgp.reliability.agreement import sensor_ranges
from semgp.reliability.confusion import Confusion, learn_confusion
from semgp.reliability.evidence import probability_right
from semgp.reliability.ranges import RangeConfidence, learn_range_confidence
from tests.reliability.annotators import CONFUSION, FOUR, FREQUENCIES, RESOLUTION, annotated, pose


def perfect(truth: NDArray[np.int64], cloud: LabelledCloud, rng: np.random.Generator) -> NDArray[np.int64]:
    return truth


LAW, NEAR_EVIDENCE = RangeConfidence(range_0=25.0, power=3.0, floor=0.2), 4.0


def by_range(truth: NDArray[np.int64], cloud: LabelledCloud, rng: np.random.Generator) -> NDArray[np.int64]:
    right = rng.random(len(truth)) < probability_right(NEAR_EVIDENCE * LAW.at(sensor_ranges(cloud)), 4)
    return np.where(right, truth, (truth + rng.integers(1, 4, len(truth))) % 4)


def test_confusion_is_found_again(confused: list[LabelledCloud]) -> None:
    found = learn_confusion(confused, resolution=RESOLUTION, iterations=200, prior=1e-3)
    assert found.converged
    assert 1 < found.iterations < 200
    np.testing.assert_allclose(found.matrix, CONFUSION, atol=0.03)
    np.testing.assert_allclose(found.frequencies, FREQUENCIES, atol=0.03)
    joint = FREQUENCIES[:, None] * CONFUSION
    np.testing.assert_allclose(found.true_given_said, (joint / joint.sum(axis=0)).T, atol=0.05)
    np.testing.assert_allclose(found.reliability, (joint / joint.sum(axis=0)).diagonal(), atol=0.05)
    assert (np.argsort(found.class_confidence) == np.argsort(found.reliability)).all()


def test_prior_believes_in_labels(confused: list[LabelledCloud]) -> None:
    found = learn_confusion(confused, resolution=RESOLUTION, prior=1e4)
    said = found.frequencies
    np.testing.assert_allclose(found.matrix, 0.9 * np.eye(4) + 0.1 * said, atol=0.01)


def test_more_steps_are_more_likely(confused: list[LabelledCloud]) -> None:
    steps = [learn_confusion(confused, resolution=RESOLUTION, iterations=i) for i in (1, 2, 4, 8)]
    assert (np.diff([c.log_likelihood for c in steps]) > 0).all()
    assert [c.iterations for c in steps] == [1, 2, 4, 8]


def test_range_law_is_found_again() -> None:
    learned = learn_range_confidence(annotated(by_range, scans=6, voxels=80_000), resolution=RESOLUTION)
    r = np.linspace(2, 80, 40)
    assert learned.range_0 == pytest.approx(LAW.range_0, rel=0.15)
    np.testing.assert_allclose(learned.at(r), LAW.at(r), atol=0.07)


def test_nothing_is_made_of_perfect_labels() -> None:
    scans = annotated(perfect, voxels=2000)
    found = learn_confusion(scans, resolution=RESOLUTION, prior=1e-3)
    np.testing.assert_allclose(found.matrix, np.eye(4), atol=1e-3)
    np.testing.assert_allclose(found.class_confidence, 1)
    law = learn_range_confidence(scans, resolution=RESOLUTION)
    for cloud in scans:
        np.testing.assert_allclose(found.apply(cloud).class_weights, cloud.class_weights, atol=1e-3)
        assert np.asarray(law.apply(cloud).confidence).min() > 0.99


def test_a_confidence_of_one_changes_nothing(confused: list[LabelledCloud]) -> None:
    sure = [replace(c, confidence=np.ones(len(c), np.float32)) for c in confused]
    a, b = (learn_confusion(scans, resolution=RESOLUTION) for scans in (confused, sure))
    np.testing.assert_array_equal(a.matrix, b.matrix)
    assert learn_range_confidence(confused, resolution=RESOLUTION) == learn_range_confidence(
        sure, resolution=RESOLUTION
    )
    cloud = sure[0]
    identity = Confusion(FOUR, np.eye(4), FREQUENCIES)
    for same in (RangeConfidence(1.0, floor=1.0).apply(cloud), identity.weigh(cloud), identity.apply(cloud)):
        np.testing.assert_array_equal(same.class_weights, cloud.class_weights)
        np.testing.assert_array_equal(np.asarray(same.confidence), np.ones(len(cloud)))


def test_labels_without_confidence_do_not_speak(confused: list[LabelledCloud]) -> None:
    more = []
    for c in confused:
        points = np.concatenate([c.points, c.points])
        labels = np.concatenate([c.hard_labels, (c.hard_labels + 1) % 4])
        believed = np.arange(len(points)) < len(c)
        more.append(replace(c, points=points, labels=labels, confidence=believed.astype(np.float32)))
    a, b = (learn_confusion(scans, resolution=RESOLUTION) for scans in (confused, more))
    np.testing.assert_array_equal(a.matrix, b.matrix)


def test_soft_labels_count_as_their_class_of_most_weight(confused: list[LabelledCloud]) -> None:
    soft = [replace(c, labels=None, weights=0.3 + 0.5 * c.class_weights) for c in confused]
    a, b = (learn_confusion(scans, resolution=RESOLUTION) for scans in (confused, soft))
    np.testing.assert_array_equal(a.matrix, b.matrix)


def test_far_from_the_origin_nothing_changes(confused: list[LabelledCloud]) -> None:
    shift = np.array([5e6, -5e6, 0.0])
    away = [
        replace(c, points=c.points + shift, T_world_sensor=pose(np.asarray(c.origin) + shift)) for c in confused
    ]
    a, b = (learn_confusion(scans, resolution=RESOLUTION) for scans in (confused, away))
    np.testing.assert_allclose(a.matrix, b.matrix, rtol=1e-9)
    near, far = (learn_range_confidence(scans, resolution=RESOLUTION) for scans in (confused, away))
    np.testing.assert_allclose(near.at([5, 50]), far.at([5, 50]), atol=0.01)


def test_real_scans(data_dir: Path) -> None:
    sequence = SemanticKITTISequence(data_dir / "semantickitti_08")
    scans = [sequence.scan(i, "predictions") for i in range(0, 10, 3)]
    law, found = learn_range_confidence(scans), learn_confusion(scans)
    assert law.at(5.0) > 1.2 * law.at(50.0)
    truth = sequence.scan(0)
    right = (scans[0].hard_labels == truth.hard_labels)[truth.labelled]
    for judged in (law.apply(scans[0]), found.weigh(scans[0])):
        confidence = np.asarray(judged.confidence)[truth.labelled]
        assert confidence[right].mean() > confidence[~right].mean() + 0.02
