"""What is learned weighs labels, against naive loops."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.reliability.confusion import Confusion
from semgp.reliability.evidence import MOST_RIGHT, evidence, probability_right
from semgp.reliability.ranges import RangeConfidence
from tests.reliability.annotators import CONFUSION, FOUR, FREQUENCIES, halved, pose


def test_apply_and_weigh_against_loops() -> None:
    joint = FREQUENCIES[:, None] * CONFUSION
    p_true = [[joint[t, k] / joint[:, k].sum() for t in range(4)] for k in range(4)]
    confusion = Confusion(FOUR, CONFUSION, FREQUENCIES)
    np.testing.assert_allclose(confusion.true_given_said, p_true)
    hard = LabelledCloud(np.zeros((3, 3)), FOUR, np.array([2, MISSING, 0], np.int32), confidence=halved([0]))
    mixed = confusion.apply(hard)
    np.testing.assert_allclose(mixed.class_weights, [p_true[2], [0] * 4, p_true[0]], rtol=1e-6)
    np.testing.assert_array_equal(np.asarray(mixed.confidence), np.asarray(hard.confidence))
    c = confusion.class_confidence
    assert c.max() == 1
    np.testing.assert_allclose(np.asarray(confusion.weigh(hard).confidence), [c[2] / 2, 1, c[0]], rtol=1e-6)
    w = np.array([[0.5, 0.25, 0, 0.25], [0, 0, 0, 0], [0, 2, 0, 0]])
    soft = LabelledCloud(np.zeros((3, 3)), FOUR, weights=w)
    by_loops = [[sum(row[k] * p_true[k][t] for k in range(4)) for t in range(4)] for row in w]
    np.testing.assert_allclose(confusion.apply(soft).class_weights, by_loops, rtol=1e-6)
    np.testing.assert_allclose(confusion.apply(soft).class_weights.sum(axis=1), w.sum(axis=1), rtol=1e-6)
    expected = [0.5 * c[0] + 0.25 * c[1] + 0.25 * c[3], 1, c[1]]
    np.testing.assert_allclose(np.asarray(confusion.weigh(soft).confidence), expected, rtol=1e-6)
    bare = LabelledCloud(np.zeros((3, 3)), FOUR)
    assert confusion.apply(bare) is bare


def test_a_class_never_said_or_never_right() -> None:
    never_said = Confusion(FOUR, np.eye(4)[[0, 1, 2, 0]], FREQUENCIES)
    np.testing.assert_array_equal(never_said.true_given_said[3], [0, 0, 0, 1])
    blind = Confusion(FOUR, np.full((4, 4), 0.25), np.full(4, 0.25))
    np.testing.assert_array_equal(blind.class_confidence, 1)  # no class is better than another


@given(st.floats(0.26, MOST_RIGHT))
def test_evidence(p: float) -> None:
    w = evidence(p, 4)
    assert probability_right(w, 4) == pytest.approx(p)
    # a vote of n labels for one class and m for another, by Bayes' rule: (p / ((1 - p) / 3))^(n - m)
    assert np.exp(w) == pytest.approx(p / ((1 - p) / 3))
    assert evidence(0.25, 4) == pytest.approx(0)
    assert evidence(0.1, 4) == 0
    assert evidence(1.0, 4) == evidence(MOST_RIGHT, 4)


def test_law_of_the_range() -> None:
    law = RangeConfidence(10.0, power=2.0, floor=0.2)
    np.testing.assert_allclose(law.at([0, 10, 20]), [1, 0.2 + 0.8 / 2, 0.2 + 0.8 / 5])
    assert RangeConfidence(1e-3, 8.0).at(1e300) == 0
    points = np.array([[3.0, 4, 0], [0, 0, 0], [0, 10, 0]])
    cloud = LabelledCloud(points, FOUR, T_world_sensor=pose((0, 0, 0)), confidence=halved([0]))
    np.testing.assert_allclose(
        np.asarray(law.apply(cloud).confidence), [0.5 * float(law.at(5.0)), 1, 0.6], rtol=1e-6
    )
