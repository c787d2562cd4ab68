"""Confidence: what a label counts, from nothing to a label like any other."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.blocks.accumulate import FEATURE_UNIT, MASS_UNIT, PLACE_UNIT, SPREAD_UNIT
from semgp.blocks.answer import Answers
from semgp.blocks.field import Field
from semgp.blocks.inputs import add_cloud
from semgp.blocks.model import BlockModel
from semgp.blocks.observations import Observations
from semgp.blocks.sites import Sites
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from tests.blocks.naive import Array, featureless, voxel_index

F32 = NDArray[np.float32]
THREE = Classes(("road", "grass", "car"))
EDGE = 0.1
MODEL = BlockModel(resolution=EDGE, leaf=32)


def patch(seed: int, n: int = 400, soft: bool = False) -> LabelledCloud:
    """A patch of ground, one point in five without a label."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((-1.0, -1.0, 0.0), (1.0, 1.0, 0.15), (n, 3))
    missing = rng.random(n) < 0.2
    labels = np.where(missing, MISSING, (points[:, 0] * 3 % 3).astype(int))
    weights = rng.random((n, 3)) * np.where(missing, 0, rng.choice([0.3, 1.0, 5.0], n))[:, None]
    cloud = LabelledCloud(points, THREE, features=rng.normal(size=(n, 1)), feature_names=("height",))
    return replace(cloud, weights=weights) if soft else replace(cloud, labels=labels)


def filled(*clouds: LabelledCloud, model: BlockModel = MODEL) -> Field:
    field = Field(model, 3)
    for cloud in clouds:
        add_cloud(field, cloud)
    return field


def answers(field: Field) -> Answers:
    queries = np.random.default_rng(9).uniform(-1.2, 1.2, (500, 3))
    return field.query(queries, np.full((500, len(field.model.features)), 0.3, np.float32))


def assert_same(a: Field, b: Field) -> None:
    """To the last bit: sites, what has changed, and answers."""
    arrays, others = a.sites.to_arrays(), b.sites.to_arrays()
    assert arrays.keys() == others.keys()
    for name in arrays:
        np.testing.assert_array_equal(arrays[name], others[name], err_msg=name)
    np.testing.assert_array_equal(a.sites.drift, b.sites.drift)
    for mine, other in zip(answers(a), answers(b)):
        np.testing.assert_array_equal(mine, other)


KINDS = {
    "hard": (MODEL, False),
    "soft": (MODEL, True),
    "no class, hard": (replace(MODEL, other=True), False),
    "no class, soft": (replace(MODEL, other=True), True),
    "features": (replace(MODEL, features=("height",)), True),
}


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> tuple[BlockModel, bool]:
    return KINDS[request.param]


@pytest.mark.parametrize("uncertain", [False, True])
def test_full_confidence_changes_nothing(kind: tuple[BlockModel, bool], uncertain: bool) -> None:
    model, soft = kind
    clouds = [patch(seed, soft=soft) for seed in (0, 1)]
    if uncertain:
        clouds = [replace(c, covariances=np.tile(np.eye(3) * 1e-3, (len(c), 1, 1))) for c in clouds]
    sure = [replace(c, confidence=np.ones(len(c), np.float32)) for c in clouds]
    assert_same(filled(*sure, model=model), filled(*clouds, model=model))


def test_no_confidence_is_a_missing_label(kind: tuple[BlockModel, bool]) -> None:
    model, soft = kind
    clouds = [patch(seed, soft=soft) for seed in (2, 3)]
    ignored = [np.random.default_rng(seed).random(400) < 0.5 for seed in (4, 5)]
    ignored[0][:50] = True  # the first labels, where the map begins
    unsure = [replace(c, confidence=np.where(i, 0.0, 1.0)) for c, i in zip(clouds, ignored)]
    if soft:
        less = [replace(c, weights=np.where(i[:, None], 0, c.class_weights)) for c, i in zip(clouds, ignored)]
    else:
        less = [replace(c, labels=np.where(i, MISSING, c.hard_labels)) for c, i in zip(clouds, ignored)]
    mine = filled(*unsure, model=model)
    assert len(mine.sites) < len(filled(*clouds, model=model).sites)
    assert_same(mine, filled(*less, model=model))


@pytest.mark.parametrize("confidence", [0.0, 1e-4])
def test_labels_that_count_nothing_leave_a_field_as_new(kind: tuple[BlockModel, bool], confidence: float) -> None:
    model, soft = kind
    cloud = patch(6, soft=soft)
    weak = None if cloud.weights is None else np.minimum(cloud.weights, 0.5)
    field = filled(replace(cloud, weights=weak, confidence=np.full(400, confidence)), model=model)
    assert field.sites.origin is None
    assert (len(field.sites), len(field.sites.cells), len(field.store.stale)) == (0, 0, 0)


@pytest.mark.parametrize("parts", [2, 4, 64])
@pytest.mark.parametrize("together", [False, True])
def test_parts_of_a_label_add_up_to_one(kind: tuple[BlockModel, bool], parts: int, together: bool) -> None:
    """Half a label twice is one label: mass, place, features and answers, in one cloud or in several."""
    model, soft = kind
    cloud = patch(7, soft=soft)
    if cloud.weights is not None:  # whole parts of a step
        cloud = replace(cloud, weights=np.round(cloud.weights * 64) / 64)
    part = replace(cloud, confidence=np.full(400, 1 / parts))
    pieces = [part] * parts
    if together:
        pieces = [part[np.repeat(np.arange(400), parts)]]
    whole, added = filled(cloud, model=model), filled(*pieces, model=model)
    for name, array in whole.sites.to_arrays().items():
        np.testing.assert_array_equal(added.sites.to_arrays()[name], array, err_msg=name)
    for mine, other in zip(answers(added), answers(whole)):
        np.testing.assert_array_equal(mine, other)


def test_soft_labels_times_their_confidence() -> None:
    cloud = patch(8, soft=True)
    confidence = np.random.default_rng(0).random(400).astype(np.float32)
    assert cloud.weights is not None
    scaled = replace(cloud, weights=cloud.weights * confidence[:, None])
    assert_same(filled(replace(cloud, confidence=confidence)), filled(scaled))


def test_the_mass_of_no_class_counts_as_much_as_the_rest() -> None:
    cloud = LabelledCloud(
        np.array([[0.05, 0, 0], [1.05, 0, 0], [2.05, 0, 0]]),
        THREE,
        weights=np.array([[0.25, 0.25, 0.25], [0.5, 0.5, 0], [0.125, 0, 0]]),
        confidence=np.array([0.5, 0.25, 1.0]),
    )
    sites = filled(cloud, model=replace(MODEL, other=True)).sites
    expected = [[0.125, 0.125, 0.125, 0.125], [0.125, 0.125, 0, 0], [0.125, 0, 0, 0.875]]
    assert (sites.mass / MASS_UNIT).tolist() == expected
    np.testing.assert_allclose(sites.positions, cloud.points, atol=1e-8)


Voxels = dict[tuple[int, ...], tuple[list[int], list[int], list[int]]]


def naive_sites(points: Array, labels: NDArray[np.int32], amount: Array, height: F32, variances: Array) -> Voxels:
    """Sums of each voxel in whole numbers of any size: class mass, place and feature, variance."""
    found: Voxels = {}
    for p, c, w, f, v in zip(points / EDGE, labels, amount, height[:, 0], variances):
        steps = round(float(w) * MASS_UNIT)
        if steps == 0:
            continue
        place = [round(float(x - np.floor(x)) * PLACE_UNIT) for x in p] + [round(float(f) * FEATURE_UNIT)]
        key = tuple(np.floor(p).astype(int).tolist())
        mass, places, spread = found.setdefault(key, ([0] * 3, [0] * 4, [0] * 3))
        mass[c] += steps
        for sums, values in ((places, place), (spread, [round(float(x) * SPREAD_UNIT) for x in v])):
            for d, value in enumerate(values):
                sums[d] += steps * value
    return found


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 5e6]), st.integers(1, 4))
@settings(deadline=None, max_examples=30)
def test_any_order_against_plain_sums(seed: int, shift: float, parts: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 100))
    points = rng.uniform(0, rng.choice([0.3, 5.0]), (n, 3)) + shift * np.array([1, -1, 0.5])
    labels, height = rng.integers(0, 3, n).astype(np.int32), rng.normal(size=(n, 1)).astype(np.float32)
    confidence = (rng.random(n) * rng.choice([0, 1e-4, 0.01, 1], n)).astype(np.float32)
    variances = rng.random((n, 3)) * 0.01
    sites = Sites(3, 1, EDGE)
    for part in np.array_split(rng.permutation(n), parts):
        draws = np.ones(len(part), np.int64)
        sites.add(
            Observations(points[part], labels[part], None, height[part], confidence[part], variances[part], draws)
        )
    found: Voxels = {}
    if sites.origin is not None:
        index = (voxel_index(sites.voxels.keys) + sites.origin).tolist()
        rows = zip(index, sites.mass.tolist(), sites.place.tolist(), sites.spread[:, :3].tolist())
        found = {tuple(v): (mass, place, spread) for v, mass, place, spread in rows}
    assert found == naive_sites(points, labels, confidence, height, variances)


def test_a_site_is_where_its_surest_points_are() -> None:
    points = np.array([[0.01, 0.02, 0.03], [0.04, 0.06, 0.05]])
    features = np.array([[2.0], [10.0]])
    cloud = LabelledCloud(
        points, THREE, np.array([0, 1], np.int32), features=features, feature_names=("height",),
        confidence=np.array([0.75, 0.25], np.float32),
    )  # fmt: skip
    sites = filled(cloud, model=replace(MODEL, features=("height",))).sites
    np.testing.assert_allclose(sites.positions, [0.75 * points[0] + 0.25 * points[1]], atol=1e-8)
    np.testing.assert_allclose(sites.place[:, 3] / sites.mass.sum() / FEATURE_UNIT, 4.0)


def test_less_confidence_more_variance() -> None:
    variances = []
    for confidence in (0.05, 0.2, 1.0):
        field = filled(replace(patch(10), confidence=np.full(400, confidence)))
        variances.append(answers(field).variance.mean())
    assert variances[0] > variances[1] > variances[2]


def test_the_surer_of_two_labels_wins() -> None:
    point = np.full((2, 3), 0.05)
    for confidence in ((0.9, 0.3), (0.3, 0.9)):
        cloud = LabelledCloud(point, THREE, np.array([0, 2]), confidence=np.array(confidence))
        probability = filled(cloud).query(point[:1], featureless(1)).probability[0]
        assert (probability[0] > probability[2]) == (confidence[0] > confidence[1])


@pytest.mark.parametrize("soft", [False, True])
def test_drift_counts_what_labels_count(soft: bool) -> None:
    """See `Sites`: for a label of mass w added to n, (1 - its class's share + 1/2) w / (n + w)."""
    sites, point = Sites(2, 0, EDGE), np.zeros((1, 3))
    expected = 0.0
    for label, w, step in ((0, 0.5, 1.0), (0, 0.25, 0.5 / 3), (1, 0.25, 1.5 / 4), (1, 1.0, (1.5 - 0.25) / 2)):
        one = None if soft else np.full(1, label, np.int32)
        weights = np.eye(2, dtype=np.float32)[[label]] if soft else None
        sites.add(Observations(point, one, weights, featureless(1), np.full(1, w, np.float32)))
        expected += step
        assert sites.drift[0] == pytest.approx(expected)


@pytest.mark.parametrize("confidence", [[0.5], [0.5, np.nan], [-0.1, 1.0], [1.01, 0.0], [[0.5, 0.5]], ["a", "b"]])
def test_bad_confidence(confidence: list[float]) -> None:
    with pytest.raises(InputError, match="confidence"):
        LabelledCloud(np.zeros((2, 3)), THREE, np.zeros(2, int), confidence=np.array(confidence))
