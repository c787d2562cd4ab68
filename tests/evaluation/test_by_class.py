"""Scores class by class, against scikit-learn."""

import math

import numpy as np
import pytest
from sklearn import metrics as sk

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.evaluation.by_class import by_class
from semgp.evaluation.scores import score
from tests.test_metrics import random_case

CLASSES = Classes(("floor", "wall", "table", "sofa", "lamp"))


def test_scores_by_class_equal_scikit_learn() -> None:
    p, truth = random_case(14, c=5)
    rows = by_class(score(p / p.sum(1, keepdims=True), np.ones(len(p), dtype=bool), truth), CLASSES)
    given = p.argmax(axis=1)
    assert [row.name for row in rows] == list(CLASSES.names)
    assert [row.points for row in rows] == np.bincount(truth).tolist()
    assert [row.given for row in rows] == np.bincount(given).tolist()
    assert [row.not_observed for row in rows] == [0] * 5
    exact, found, _, _ = sk.precision_recall_fscore_support(truth, given)
    np.testing.assert_allclose([row.precision for row in rows], exact)
    np.testing.assert_allclose([row.recall for row in rows], found)
    np.testing.assert_allclose([row.iou for row in rows], sk.jaccard_score(truth, given, average=None))
    auc = [sk.roc_auc_score(truth == c, p[:, c] / p.sum(1)) for c in range(5)]
    np.testing.assert_allclose([row.auc for row in rows], auc)
    wrong = sk.confusion_matrix(truth, given) * (1 - np.eye(5, dtype=int))
    assert [row.confused for row in rows] == wrong.max(axis=1).tolist()
    assert [row.confused_with for row in rows] == [CLASSES.names[c] for c in wrong.argmax(axis=1)]


def test_scores_of_absent_classes_and_of_points_not_observed() -> None:
    p = np.eye(5)[[0, 0, 3, 1]]
    s = score(p, [True, False, True, True], [0, 0, 1, 1])
    floor, wall, table, sofa, _ = by_class(s, CLASSES)
    assert (floor.points, floor.not_observed, floor.recall, floor.precision) == (2, 1, 0.5, 1)
    assert (floor.confused_with, floor.confused, floor.probability) == (None, 0, 0.5)
    assert (wall.confused_with, wall.confused) == ("sofa", 1)
    assert (table.points, table.given, sofa.points, sofa.given, sofa.precision) == (0, 0, 0, 1, 0)
    assert all(map(math.isnan, (table.iou, table.precision, table.recall, table.auc, table.probability)))
    with pytest.raises(InputError, match="5 classes are not those of 2"):
        by_class(s, Classes(("a", "b")))
