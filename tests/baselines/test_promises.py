"""What every map owes, and the rival maps keep."""

from __future__ import annotations

import json

import numpy as np
import pytest

from semgp.baselines.knn import KNNMap
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.protocol import SemanticMap
from tests.baselines.rivals import (
    CLASSES,
    C,
    Maker,
    assert_same_answers,
    every_rival,
    filled,
    queries,
    random_cloud,
)


@every_rival
@pytest.mark.parametrize("soft", [False, True])
def test_parts_in_any_order_equal_the_whole(make: Maker, soft: bool) -> None:
    cloud, Q = random_cloud(1, soft=soft), queries(1)
    first = np.arange(len(cloud)) < 50
    whole = filled(make, cloud)
    forward, backward = filled(make, cloud[first], cloud[~first]), filled(make, cloud[~first], cloud[first])
    assert_same_answers(whole, forward, Q, Q)
    assert_same_answers(whole, backward, Q, Q)
    assert len(whole) == len(forward) == len(backward)


@every_rival
def test_hard_and_soft_clouds_mix(make: Maker) -> None:
    hard, soft, Q = random_cloud(2), random_cloud(3, soft=True), queries(2)
    assert_same_answers(filled(make, hard, soft), filled(make, soft, hard), Q, Q)


@every_rival
def test_soft_one_hot_labels_equal_hard_labels(make: Maker) -> None:
    hard, Q = random_cloud(4), queries(4)
    assert hard.labels is not None
    weights = np.where(hard.labelled[:, None], np.eye(C, dtype=np.float32)[hard.labels], 0)
    soft = LabelledCloud(hard.points, CLASSES, weights=weights)
    assert_same_answers(filled(make, hard), filled(make, soft), Q, Q)


@every_rival
def test_five_thousand_kilometres_away_the_answers_are_the_same(make: Maker) -> None:
    cloud, Q, far = random_cloud(5), queries(5), np.array([5e6, -5e6, 1250.0])
    moved = LabelledCloud(cloud.points + far, CLASSES, labels=cloud.labels)
    assert_same_answers(filled(make, cloud), filled(make, moved), Q, Q + far)


@every_rival
def test_a_query_far_from_the_data_has_a_proper_answer(make: Maker) -> None:
    rival = filled(make, random_cloud(6))
    answer = rival.query(np.array([[1e9, 0, 0], [-3e4, 2e4, 5e3]]))
    np.testing.assert_allclose(answer.probability.sum(axis=1), 1, rtol=1e-5)
    far_is_observed = isinstance(rival, KNNMap) and rival.max_distance is None
    assert answer.observed.tolist() == [far_is_observed] * 2
    if not far_is_observed:
        np.testing.assert_allclose(answer.probability, 1 / C, rtol=1e-6)


@every_rival
def test_points_without_labels_change_nothing(make: Maker) -> None:
    cloud, Q = random_cloud(7), queries(7)
    empty = LabelledCloud(np.zeros((0, 3)), CLASSES)
    unlabelled = LabelledCloud(queries(8), CLASSES)
    all_missing = LabelledCloud(queries(8), CLASSES, labels=np.full(60, -1, np.int32))
    plain, padded = filled(make, cloud), filled(make, empty, unlabelled, cloud, all_missing)
    assert_same_answers(plain, padded, Q, Q)
    assert len(plain) == len(padded)
    assert len(plain.query(np.zeros((0, 3)))) == 0


@every_rival
def test_a_map_without_data_does_not_answer(make: Maker) -> None:
    rival = make()
    with pytest.raises(InputError, match="no labelled points"):
        rival.query(queries(9))
    rival.update(LabelledCloud(queries(9), CLASSES))
    assert len(rival) == 0
    with pytest.raises(InputError, match="no labelled points"):
        rival.query(queries(9))


@every_rival
@pytest.mark.parametrize("n", [0, 80])
def test_round_trip_through_arrays(make: Maker, n: int) -> None:
    rival = filled(make, random_cloud(11, n, soft=True), random_cloud(12, n))
    header, arrays = rival.to_arrays()
    header = json.loads(json.dumps(header, allow_nan=False))
    again = type(rival).from_arrays(CLASSES, header, arrays)
    assert isinstance(again, SemanticMap)
    assert again.info() == rival.info()
    assert json.loads(json.dumps(again.info()))["kind"] == rival.kind
    again.update(random_cloud(13))
    rival.update(random_cloud(13))
    assert_same_answers(rival, again, queries(11), queries(11))
