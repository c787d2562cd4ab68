"""Metrics against scikit-learn and naive loops."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from sklearn import metrics as sk

from semgp.errors import InputError
from semgp.evaluation.auc import auc_total, hand_till_auc, one_vs_rest_auc
from semgp.evaluation.calibration import FLOOR, brier, ece, nll, probability_of_truth, reliability
from semgp.evaluation.metrics import accuracy, confusion, iou, precision, recall
from semgp.evaluation.scores import score
from tests import naive

Case = tuple[NDArray[np.float64], NDArray[np.int64]]


def random_case(seed: int, n: int = 400, c: int = 5, decimals: int = 12, missing: bool = False) -> Case:
    """Return probabilities, with many ties where decimals are few, and truth of every class."""
    rng = np.random.default_rng(seed)
    p = np.round(rng.dirichlet(np.full(c, 0.7), n), decimals)
    truth = np.where(rng.random(n) < 0.6, p.argmax(axis=1), rng.integers(0, c, n))
    truth[:c] = np.arange(c)
    if missing:
        truth[c : n // 3] = -1
    return p, truth


@given(st.integers(0, 2**32), st.integers(2, 30), st.integers(1, 4), st.integers(0, 3))
@settings(max_examples=60, deadline=None)
def test_one_vs_rest_auc_equals_counting_pairs(seed: int, n: int, c: int, decimals: int) -> None:
    rng = np.random.default_rng(seed)
    s, truth = np.round(rng.random((n, c)), decimals), rng.integers(-1, c, n)
    np.testing.assert_allclose(one_vs_rest_auc(s, truth), naive.one_vs_rest_auc(s, truth), rtol=1e-14)


@pytest.mark.parametrize("decimals", [1, 12])
def test_auc_equals_scikit_learn(decimals: int) -> None:
    p, truth = random_case(1, decimals=decimals)
    rows = p / p.sum(axis=1, keepdims=True)  # scikit-learn insists
    each = sk.roc_auc_score(truth, rows, multi_class="ovr", average=None)
    np.testing.assert_allclose(one_vs_rest_auc(rows, truth), each, rtol=1e-13)
    assert auc_total(rows, truth) == pytest.approx(each.mean(), rel=1e-13)
    pairs = sk.roc_auc_score(truth, rows, multi_class="ovo", average="macro")
    assert hand_till_auc(rows, truth) == pytest.approx(pairs, rel=1e-13)


def test_hand_till_equals_counting_pairs_and_skips_absent_classes() -> None:
    p, truth = random_case(2, n=60, decimals=1)
    truth[truth == 3] = 1
    assert hand_till_auc(p, truth) == pytest.approx(naive.hand_till_auc(p, truth), rel=1e-13)
    assert math.isnan(hand_till_auc(p, np.ones_like(truth)))


def test_auc_is_nan_without_positives_or_negatives_and_the_mean_skips_it() -> None:
    s = np.array([[0.9, 0.1, 0.0], [0.2, 0.8, 0.0], [0.6, 0.4, 0.0]])
    auc = one_vs_rest_auc(s, [0, 1, 0])
    np.testing.assert_array_equal(auc, [1, 1, math.nan])
    assert auc_total(s, [0, 1, 0]) == 1
    assert np.isnan(one_vs_rest_auc(s, [1, 1, 1])).all()
    assert math.isnan(auc_total(s, [1, 1, 1]))


def test_all_scores_tied_is_one_half() -> None:
    assert one_vs_rest_auc(np.zeros((6, 2)), [0, 1, 0, 1, 1, 1]).tolist() == [0.5, 0.5]


def test_float32_ranks_like_the_same_numbers_in_float64() -> None:
    p, truth = random_case(3)
    p32 = p.astype(np.float32)
    np.testing.assert_array_equal(one_vs_rest_auc(p32, truth), one_vs_rest_auc(p32.astype(float), truth))


def test_points_without_truth_are_left_out_by_every_metric() -> None:
    p, truth = random_case(4, missing=True)
    known = truth >= 0
    assert 0 < known.sum() < len(truth)
    for metric in (auc_total, hand_till_auc, nll, brier, ece):
        assert metric(p, truth) == metric(p[known], truth[known])
    label = p.argmax(axis=1)
    np.testing.assert_array_equal(confusion(label, truth, 5), confusion(label[known], truth[known], 5))


def test_nll_and_brier_equal_scikit_learn() -> None:
    p, truth = random_case(5)
    assert nll(p, truth) == pytest.approx(sk.log_loss(truth, p / p.sum(1, keepdims=True)), rel=1e-9)
    assert brier(p, truth) == pytest.approx(((p - np.eye(5)[truth]) ** 2).sum(axis=1).mean(), rel=1e-12)


def test_nll_is_floored_and_brier_of_a_withheld_answer_is_one() -> None:
    assert nll([[1.0, 0.0]], [1]) == pytest.approx(-math.log(FLOOR))
    assert brier([[1.0, 0.0]], [1]) == 2
    assert brier([[0.0, 0.0]], [1]) == 1


@pytest.mark.parametrize("bins", [1, 10, 15])
def test_ece_equals_naive_bins(bins: int) -> None:
    p, truth = random_case(6, missing=True)
    assert ece(p, truth, bins) == pytest.approx(naive.ece(p, truth, bins), rel=1e-12)


def test_reliability_of_a_known_case() -> None:
    p = np.array([[0.9, 0.1], [0.9, 0.1], [0.6, 0.4], [0.0, 0.0]])
    diagram = reliability(p, [0, 1, 0, 0], bins=2)
    assert diagram.count.tolist() == [1, 3]
    assert diagram.edges.tolist() == [0, 0.5, 1]
    np.testing.assert_allclose(diagram.confidence, [0, 0.8])
    np.testing.assert_allclose(diagram.accuracy, [0, 2 / 3])
    assert diagram.ece == pytest.approx(0.75 * (0.8 - 2 / 3))


def test_perfectly_calibrated_answers_have_no_error() -> None:
    rng = np.random.default_rng(7)
    p = rng.dirichlet(np.ones(3), 200_000)
    truth = (rng.random(len(p))[:, None] > p.cumsum(axis=1)[:, :-1]).sum(axis=1)
    assert ece(p, truth) < 0.005
    assert ece(p**4 / (p**4).sum(axis=1, keepdims=True), truth) > 0.1


def test_confusion_accuracy_and_iou_equal_scikit_learn() -> None:
    p, truth = random_case(8)
    label = p.argmax(axis=1)
    table = confusion(label, truth, 5)
    np.testing.assert_array_equal(table[:, :5], sk.confusion_matrix(truth, label))
    assert accuracy(table) == sk.accuracy_score(truth, label)
    np.testing.assert_allclose(iou(table), sk.jaccard_score(truth, label, average=None))


def test_precision_and_recall_equal_scikit_learn() -> None:
    p, truth = random_case(12, missing=True)
    label, known = p.argmax(axis=1), truth >= 0
    table = confusion(label, truth, 5)
    for ours, theirs in ((precision, sk.precision_score), (recall, sk.recall_score)):
        np.testing.assert_allclose(ours(table), theirs(truth[known], label[known], average=None))


def test_precision_and_recall_without_points() -> None:
    table = confusion([0, 0, -1, 2], [0, 1, 1, 0], 4)
    np.testing.assert_array_equal(precision(table), [0.5, math.nan, 0, math.nan])
    np.testing.assert_array_equal(recall(table), [0.5, 0, math.nan, math.nan])


def test_probability_of_truth_is_the_mean_over_the_points_of_each_class() -> None:
    p, truth = random_case(13, missing=True)
    truth[truth == 2] = 1
    means = [p[truth == c, c].mean() if (truth == c).any() else math.nan for c in range(5)]
    np.testing.assert_allclose(probability_of_truth(p, truth), means)


def test_withheld_answers_are_wrong_but_no_false_alarm() -> None:
    table = confusion([0, -1, 1, 1], [0, 0, 1, 1], 3)
    assert table[:, -1].tolist() == [1, 0, 0]
    assert accuracy(table) == 0.75
    np.testing.assert_array_equal(iou(table), [0.5, 1, math.nan])


def test_score_over_all_points_counts_the_unobserved_as_zeros() -> None:
    p, truth = random_case(9, missing=True)
    observed = np.random.default_rng(9).random(len(p)) < 0.7
    s = score(p, observed, truth)
    known = truth >= 0
    zeroed = np.where(observed[:, None], p, 0)[known]
    y = truth[known]
    assert s.n_points == known.sum()
    assert s.coverage == observed[known].mean()
    assert s.auc_total == pytest.approx(np.nanmean(naive.one_vs_rest_auc(zeroed, y)))
    assert s.auc_hand_till == pytest.approx(naive.hand_till_auc(zeroed, y))
    assert s.accuracy == ((p.argmax(axis=1) == truth) & observed)[known].mean()
    p_true = np.where(observed[known], p[known, y], 0)
    assert s.nll == pytest.approx(-np.log(np.maximum(p_true, 1e-6)).mean())
    assert s.brier == pytest.approx(((zeroed - np.eye(5)[y]) ** 2).sum(axis=1).mean())
    assert s.ece == pytest.approx(ece(zeroed, y)) == s.reliability.ece
    assert s.miou == pytest.approx(s.iou.mean())


def test_score_over_observed_points_ignores_the_others() -> None:
    p, truth = random_case(10)
    observed = np.arange(len(p)) % 3 > 0
    alone = score(p, observed, truth).on_observed
    subset = score(p[observed], observed[observed], truth[observed])
    assert alone is not None
    assert alone.on_observed is None
    assert alone.to_json() | {"on_observed": None} == subset.to_json() | {"on_observed": None}
    assert subset.on_observed is not None
    assert subset.on_observed.to_json() == alone.to_json()
    assert subset.coverage == 1


def test_score_of_a_map_that_observed_nothing() -> None:
    s = score(np.full((4, 2), 0.5), np.zeros(4, dtype=bool), [0, 1, 1, -1])
    assert (s.on_observed, s.coverage, s.accuracy, s.miou, s.auc_total) == (None, 0, 0, 0, 0.5)
    assert s.nll == pytest.approx(-math.log(1e-6))


def test_scores_are_ready_for_strict_json() -> None:
    p, truth = random_case(11)
    truth[truth == 2] = 1
    text = json.dumps(score(p, np.ones(len(p), dtype=bool), truth).to_json(), allow_nan=False)
    assert json.loads(text)["auc"][2] is None


@pytest.mark.parametrize(
    ("p", "truth", "words"),
    [
        (np.zeros((3, 2)), [0, 1], "shape"),
        (np.zeros(3), [0, 1, 1], "shape"),
        (np.zeros((2, 2)), [0, 2], "between 0 and 1"),
        (np.zeros((2, 2)), [0, -2], "missing"),
        (np.zeros((2, 2)), [0.0, 1.0], "whole numbers"),
        (np.array([[math.nan, 0.5]]), [0], "NaN"),
        (np.array([[-0.1, 0.5]]), [0], "between 0 and 1"),
        (np.array([[1.5, 0.5]]), [0], "between 0 and 1"),
        (np.array([["a", "b"]]), [0], "numbers"),
    ],
)
def test_bad_input_is_refused(p: NDArray[np.float64], truth: list[int], words: str) -> None:
    with pytest.raises(InputError, match=words):
        nll(p, truth)
    with pytest.raises(InputError, match=words):
        score(p, np.ones(len(truth), dtype=bool), truth)


def test_score_refuses_a_mask_that_is_none_and_empty_truth() -> None:
    with pytest.raises(InputError, match="bool"):
        score(np.zeros((2, 2)), [0, 1], [0, 1])
    with pytest.raises(InputError, match="nothing to score"):
        score(np.zeros((2, 2)), [True, True], [-1, -1])
    with pytest.raises(InputError, match="at least one bin"):
        reliability(np.zeros((2, 2)), [0, 1], bins=0)
    with pytest.raises(InputError, match="labels"):
        confusion([0, 5], [0, 1], 2)
