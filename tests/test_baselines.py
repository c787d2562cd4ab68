"""The rival maps against naive loops, and what every map owes."""

from __future__ import annotations

import json
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
from semgp.errors import InputError
from semgp.evaluation.scores import score
from semgp.maps.protocol import SemanticMap
from semgp.readers.nyu import NYUFolder
from semgp.voxels import HALF_RANGE, MARGIN, OUTSIDE, VoxelTable, voxel_centres, voxel_keys, voxel_origin
from tests import naive

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


def mass_of(cloud: LabelledCloud) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the labelled points and their class mass, written out here on purpose."""
    keep = cloud.labelled
    if cloud.weights is not None:
        return cloud.points[keep], cloud.weights[keep].astype(float)
    assert cloud.labels is not None
    return cloud.points[keep], np.eye(C)[cloud.labels[keep]]


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
def test_other_classes_and_bad_queries_are_refused(make: Maker) -> None:
    rival = filled(make, random_cloud(10))
    with pytest.raises(InputError, match="classes"):
        rival.update(LabelledCloud(np.zeros((1, 3)), Classes(("a",)), labels=np.zeros(1, np.int32)))
    for bad in (np.zeros((2, 2)), np.full((1, 3), np.nan)):
        with pytest.raises(InputError, match="query points"):
            rival.query(bad)


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


@every_rival
def test_damaged_arrays_are_refused(make: Maker) -> None:
    rival = filled(make, random_cloud(14))
    header, arrays = rival.to_arrays()
    for name, a in arrays.items():
        without = {k: v for k, v in arrays.items() if k != name}
        bad = [without, arrays | {name: a.astype(np.complex128)}, arrays | {name: a[..., None]}]
        bad += [arrays | {name: a[:-1]}] if name != "votes" else [arrays | {name: a[:1]}]
        bad += [arrays | {name: a - a.dtype.type(2)}] if name in ("mass", "votes", "vote_of") else []
        bad += [arrays | {name: np.full_like(a, 7)}] if name == "keys" else []
        bad += [arrays | {name: np.full_like(a, np.nan)}] if name == "points" else []
        for damaged in bad:
            with pytest.raises(InputError):
                type(rival).from_arrays(CLASSES, header, damaged)
    for name in header:
        with pytest.raises(InputError, match=name):
            type(rival).from_arrays(CLASSES, {k: v for k, v in header.items() if k != name}, arrays)
    with pytest.raises(InputError):
        type(rival).from_arrays(Classes.numbered(C + 1), header, arrays)


@pytest.mark.parametrize(
    "build",
    [
        lambda: KNNMap(CLASSES, k=0),
        lambda: KNNMap(CLASSES, k=1.5),  # type: ignore[arg-type]
        lambda: KNNMap(CLASSES, width=0),
        lambda: KNNMap(CLASSES, kernel="box"),  # type: ignore[arg-type]
        lambda: KNNMap(CLASSES, max_distance=-1),
        lambda: KNNMap(CLASSES, alpha0=-1),
        lambda: CSMMap(CLASSES, resolution=0),
        lambda: CSMMap(CLASSES, resolution="wide"),  # type: ignore[arg-type]
        lambda: CSMMap(CLASSES, alpha0=float("nan")),
        lambda: BKIMap(CLASSES, ell=-0.3),
        lambda: BKIMap(CLASSES, resolution=0.01, ell=1.0),
        lambda: BKIMap(CLASSES, sigma0=float("inf")),
        lambda: BKIMap(CLASSES, alpha0=0),
    ],
)
def test_settings_that_make_no_sense_are_refused(build: Maker) -> None:
    with pytest.raises(InputError):
        build()


def test_fewer_points_than_neighbours_all_vote() -> None:
    rival = KNNMap(CLASSES, k=50)
    rival.update(LabelledCloud(np.eye(3), CLASSES, labels=np.array([0, 1, 1], np.int32)))
    np.testing.assert_allclose(rival.query([[0, 0, 0]]).probability, [[1 / 3, 2 / 3, 0, 0]], rtol=1e-6)


def test_a_failed_first_update_leaves_the_map_as_it_was() -> None:
    stray = LabelledCloud(np.array([[0, 0, 0], [1e6, 0, 0]]), CLASSES, labels=np.array([0, 1], np.int32))
    good = LabelledCloud(np.array([[2e6, 0, 0]]), CLASSES, labels=np.array([2], np.int32))
    for rival in (CSMMap(CLASSES, 0.02), BKIMap(CLASSES, 0.02, 0.1)):
        with pytest.raises(InputError, match="stray points"):
            rival.update(stray)
        assert len(rival) == 0
        rival.update(good)
        assert rival.query(good.points).label.tolist() == [2]


@given(
    st.integers(0, 2**32),
    st.sampled_from([0.01, 0.02, 0.1, 0.25, 1.0]),
    st.sampled_from([0.0, 5e6, -1e7]),
)
@settings(max_examples=40, deadline=None)
def test_keys_tell_voxels_apart_exactly(seed: int, resolution: float, away: float) -> None:
    points = np.random.default_rng(seed).normal(away, 5 * resolution, (200, 3))
    keys = voxel_keys(points, resolution, voxel_origin(points, resolution))
    voxel = np.floor(points / resolution)
    same_voxel = (voxel[:, None] == voxel[None]).all(axis=2)
    np.testing.assert_array_equal(keys[:, None] == keys[None], same_voxel)
    centres = voxel_centres(keys, resolution, voxel_origin(points, resolution))
    np.testing.assert_allclose(centres, (voxel + 0.5) * resolution, rtol=1e-15)


def test_keys_out_of_range_are_refused_or_marked() -> None:
    edge = float(HALF_RANGE - MARGIN)
    inside, outside = np.array([[0, edge - 1, -edge]]), np.array([[0, edge, 0]])
    assert voxel_keys(inside, 1.0)[0] > 0
    with pytest.raises(InputError, match="larger voxels"):
        voxel_keys(outside, 1.0)
    far = np.array([[1e300, 0, 0], [0, -float(HALF_RANGE) - 1, 0]])
    assert voxel_keys(far, 1.0, allow_outside=True).tolist() == [OUTSIDE, OUTSIDE]
    with pytest.raises(InputError, match="cannot be put"):
        voxel_origin(far, 1.0)


def test_the_table_agrees_with_a_dictionary() -> None:
    rng = np.random.default_rng(15)
    table = VoxelTable()
    rows: dict[int, int] = {}
    for _ in range(20):
        keys = rng.integers(0, 2**62, 50) // 2**40 * 2**40 // rng.integers(1, 4)
        for key in keys:
            rows.setdefault(int(key), len(rows))
        assert table.insert(keys).tolist() == [rows[int(key)] for key in keys]
    assert table.keys.tolist() == list(rows)
    strangers = np.array([OUTSIDE, 1, 2, 3])
    assert table.find(np.concatenate([table.keys, strangers])).tolist() == [*range(len(rows)), -1, -1, -1, -1]


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
