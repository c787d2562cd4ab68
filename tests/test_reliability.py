"""Label reliability: known annotators are found again, loops give the same, nothing is made of perfect labels."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.readers import SemanticKITTISequence
from semgp.reliability.agreement import BINS, range_agreement, sensor_ranges
from semgp.reliability.confusion import Confusion, learn_confusion
from semgp.reliability.dawid_skene import Errors, Expected, expect, fit, maximise
from semgp.reliability.evidence import MOST_RIGHT, evidence, probability_right
from semgp.reliability.ranges import RangeConfidence, learn_range_confidence
from semgp.reliability.votes import scan_votes, usable_scans

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


def perfect(truth: NDArray[np.int64], cloud: LabelledCloud, rng: np.random.Generator) -> NDArray[np.int64]:
    return truth


LAW, NEAR_EVIDENCE = RangeConfidence(range_0=25.0, power=3.0, floor=0.2), 4.0


def by_range(truth: NDArray[np.int64], cloud: LabelledCloud, rng: np.random.Generator) -> NDArray[np.int64]:
    right = rng.random(len(truth)) < probability_right(NEAR_EVIDENCE * LAW.at(sensor_ranges(cloud)), 4)
    return np.where(right, truth, (truth + rng.integers(1, 4, len(truth))) % 4)


@pytest.fixture(scope="module")
def confused() -> list[LabelledCloud]:
    return annotated(by_confusion)


def naive_shares(scans: Sequence[LabelledCloud]) -> dict[tuple[int, ...], dict[int, dict[int, float]]]:
    """Voxel -> scan -> label -> share, of the voxels that two scans have seen."""
    said: dict[tuple[int, ...], dict[int, dict[int, float]]] = defaultdict(
        lambda: defaultdict(lambda: defaultdict(float))
    )
    for i, cloud in enumerate(scans):
        for j, point in enumerate(cloud.points):
            mass = 1.0 if cloud.confidence is None else float(cloud.confidence[j])
            if cloud.hard_labels[j] != MISSING and mass > 0:
                said[tuple(np.floor(point / RESOLUTION).astype(int))][i][int(cloud.hard_labels[j])] += mass
    for voxel in said.values():
        for shares in voxel.values():
            total = sum(shares.values())
            shares.update({label: mass / total for label, mass in shares.items()})
    return {v: dict(by_scan) for v, by_scan in said.items() if len(by_scan) >= 2}


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_votes_against_loops(seed: int) -> None:
    scans = random_scans(seed)
    expected = naive_shares(scans)
    used = usable_scans(scans, RESOLUTION)
    votes = scan_votes(used, [c.hard_labels for c in used], RESOLUTION)
    found: dict[int, dict[int, dict[int, float]]] = defaultdict(lambda: defaultdict(dict))
    for voxel, scan, kind, share in zip(votes.voxel, votes.scan, votes.kind, votes.share):
        assert int(kind) not in found[voxel][scan]
        found[int(voxel)][int(scan)][int(kind)] = float(share)

    def as_rows(voxels: dict) -> list:  # type: ignore[type-arg]
        return sorted([sorted((s, k, round(x, 9)) for s, k2 in v.items() for k, x in k2.items()) for v in voxels])

    assert as_rows(found.values()) == as_rows(expected.values())  # type: ignore[arg-type]
    assert sorted(votes.scans) == sorted(len(v) for v in expected.values())
    assert sorted(found) == list(range(len(votes.scans)))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_agreement_against_loops(seed: int) -> None:
    scans = [replace(c, confidence=None) for c in random_scans(seed, points=30)]
    ranges = [sensor_ranges(c)[c.labelled] for c in scans]
    edges = np.geomspace(min(r.min() for r in ranges), max(r.max() for r in ranges), BINS + 1)[1:-1]
    entries: dict[tuple[int, ...], list[tuple[int, int, int]]] = defaultdict(list)
    for i, cloud in enumerate(scans):
        for point, label in zip(cloud.points[cloud.labelled], cloud.hard_labels[cloud.labelled]):
            at = int(np.searchsorted(edges, np.linalg.norm(point - cloud.origin)))
            entries[tuple(np.floor(point / RESOLUTION).astype(int))].append((i, int(label), at))
    pairs, agreeing = np.zeros((BINS, BINS)), np.zeros((BINS, BINS))
    for said in entries.values():
        size = {i: sum(j == i for j, _, _ in said) for i, _, _ in said}
        for (i, label, at), (j, other, there) in combinations(said, 2):
            if i != j:
                share = 1 / size[i] / size[j] / (len(size) - 1)
                for pair in ((at, there), (there, at)):
                    pairs[pair] += share
                    agreeing[pair] += share * (label == other)
    found = range_agreement(scans, resolution=RESOLUTION)
    filled = np.unique(np.searchsorted(edges, np.concatenate(ranges)))
    np.testing.assert_allclose(found.pairs, pairs[np.ix_(filled, filled)], atol=1e-9)
    np.testing.assert_allclose(found.agreeing, agreeing[np.ix_(filled, filled)], atol=1e-9)
    rate = agreeing.sum(axis=1)[filled] / np.where(pairs.sum(axis=1) > 0, pairs.sum(axis=1), np.nan)[filled]
    known = pairs.sum(axis=1)[filled] > 1e-9
    np.testing.assert_allclose(found.rate[known], rate[known], atol=1e-9)


def random_votes(seed: int, items: int = 40) -> tuple[F64, Errors]:
    rng = np.random.default_rng(seed)
    N = rng.choice([0.0, 0.5, 1.0, 3.0], (items, 4)) + np.eye(4)[rng.integers(0, 4, items)]
    return N, Errors(rng.uniform(0.1, 2, (4, 4)), rng.uniform(0.1, 2, 4))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_one_step_of_em_against_loops(seed: int) -> None:
    N, prior = random_votes(seed)
    errors = maximise(Expected(np.zeros((4, 4)), np.zeros(4), 0.0), prior)
    said, true, log_likelihood = np.zeros((4, 4)), np.zeros(4), 0.0
    for row in N:
        joint = [
            errors.frequencies[t] * np.prod([errors.matrix[t, k] ** row[k] for k in range(4)]) for t in range(4)
        ]
        log_likelihood += float(np.log(sum(joint)))
        for t in range(4):
            true[t] += joint[t] / sum(joint)
            for k in range(4):
                said[t, k] += joint[t] / sum(joint) * row[k]
    expected = expect(csr_array(N), errors)
    np.testing.assert_allclose(expected.said, said)
    np.testing.assert_allclose(expected.true, true)
    assert expected.log_likelihood == pytest.approx(log_likelihood)
    new = maximise(expected, prior)
    for t in range(4):
        assert new.frequencies[t] == pytest.approx(
            (true[t] + prior.frequencies[t]) / (40 + prior.frequencies.sum())
        )
        for k in range(4):
            total = said[t].sum() + prior.matrix[t].sum()
            assert new.matrix[t, k] == pytest.approx((said[t, k] + prior.matrix[t, k]) / total)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_likelihood_never_falls(seed: int) -> None:
    N, prior = random_votes(seed)
    objectives = [fit(csr_array(N), prior, iterations).objective for iterations in range(1, 15)]
    assert (np.diff(objectives) > -1e-12).all()
    assert objectives[-1] > objectives[0]


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


TWO = random_scans(1, n=2)
LEARN = (learn_confusion, learn_range_confidence)


@pytest.mark.parametrize("learn", LEARN)
@pytest.mark.parametrize(
    ("scans", "message"),
    [
        ([], "0 of 0 scans"),
        (TWO[:1], "1 of 1 scans have labels"),
        ([TWO[0], replace(TWO[1], labels=None)], "1 of 2 scans have labels"),
        ([TWO[0], replace(TWO[1], confidence=np.zeros(60, np.float32))], "1 of 2 scans have labels"),
        ([TWO[0], replace(TWO[1], points=TWO[1].points + 50)], "no voxel of 0.25 m"),
        ([TWO[0], replace(TWO[1], points=TWO[1].points + 5e6)], "more than"),
        ([TWO[0], replace(TWO[1], classes=Classes.numbered(4))], "classes differ"),
        ([replace(c, classes=Classes(("all",)), labels=np.zeros(60, int)) for c in TWO], "one class, all"),
    ],
)
def test_scans_that_teach_nothing(learn: Callable[..., object], scans: list[LabelledCloud], message: str) -> None:
    with pytest.raises(InputError, match=message):
        learn(scans, resolution=RESOLUTION)


@pytest.mark.parametrize("learn", LEARN)
@pytest.mark.parametrize("resolution", [0.0, -1.0, np.nan, np.inf])
def test_bad_resolution(learn: Callable[..., object], resolution: float) -> None:
    with pytest.raises(InputError, match="resolution must be a positive number"):
        learn(TWO, resolution=resolution)


def test_ranges_need_poses() -> None:
    blind = [replace(c, T_world_sensor=None) for c in TWO]
    with pytest.raises(InputError, match="T_world_sensor"):
        learn_range_confidence(blind, resolution=RESOLUTION)
    with pytest.raises(InputError, match="T_world_sensor"):
        RangeConfidence(1.0).apply(blind[0])
    learn_confusion(blind, resolution=RESOLUTION)  # which needs none


@pytest.mark.parametrize(
    "settings",
    [{"iterations": 0}, {"prior": 0.0}, {"prior": np.nan}, {"prior": np.inf}],
)
def test_bad_settings(settings: dict[str, float]) -> None:
    with pytest.raises(InputError, match="iterations must be"):
        learn_confusion(TWO, resolution=RESOLUTION, **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "law",
    [(0.0, 2.0, 0.0), (np.nan, 2.0, 0.0), (1.0, -1.0, 0.0), (1.0, np.inf, 0.0), (1.0, 2.0, 1.5), (1, 1, np.nan)],
)
def test_bad_law(law: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="must"):
        RangeConfidence(*law)


@pytest.mark.parametrize(
    ("classes", "matrix", "frequencies", "message"),
    [
        (FOUR, np.eye(3), FREQUENCIES, "matrix"),
        (FOUR, np.eye(4) * 2, FREQUENCIES, "matrix"),
        (FOUR, np.eye(4) * np.nan, FREQUENCIES, "matrix"),
        (FOUR, np.eye(4) * 2 - 1 / 4, FREQUENCIES, "matrix"),
        (FOUR, CONFUSION, FREQUENCIES[:3], "frequencies"),
        (FOUR, CONFUSION, FREQUENCIES * 2, "frequencies"),
        (Classes(("all",)), np.eye(1), np.ones(1), "two classes"),
    ],
)
def test_bad_confusion(classes: Classes, matrix: F64, frequencies: F64, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Confusion(classes, matrix, frequencies)


def test_confusion_of_other_classes() -> None:
    confusion = Confusion(Classes.numbered(4), CONFUSION, FREQUENCIES)
    for method in (confusion.apply, confusion.weigh):
        with pytest.raises(InputError, match="road"):
            method(TWO[0])
