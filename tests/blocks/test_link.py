"""From latent values to probabilities: the pool, the share of errors and the mass of no class, by the formulas."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.blocks.answer import prior_probabilities
from semgp.blocks.field import Field
from semgp.blocks.learning import error_frequencies
from semgp.blocks.link import class_probabilities
from semgp.blocks.model import CLOSED, BlockModel
from semgp.blocks.observations import Observations
from semgp.blocks.patches import Patch
from semgp.errors import InputError
from semgp.gp.stationary import Matern52
from tests.blocks.naive import blended, featureless, less_errors, pairs_of, street, unknown

C = 4
MODEL = BlockModel(prior=(0.4, 0.3, 0.2, 0.1), leaf=20, near=6, far=10)
MODELS = {
    "errors": replace(MODEL, error_rate=0.4, errors=(0.1, 0.2, 0.3, 0.4)),
    "even errors": replace(MODEL, error_rate=2.0, error_power=1.3),
    "other": replace(MODEL, other=True),
    "errors by other": replace(MODEL, other=True, error_rate=0.7, errors=(4, 3, 2, 1)),
    "errors of a vote": replace(MODEL, posterior="vote", weights=(0, 0, 1), other=True, error_rate=0.7),
}


def pooled(F: NDArray[np.float32], present: list[int], model: BlockModel, n_classes: int) -> NDArray[np.float64]:
    """Pooled probabilities (m, C) of latent values (3 + 3 P, m): in full for each class, present or not."""
    P, prior = len(present), model.class_prior(n_classes).astype(np.float64)
    log_p = np.zeros((n_classes, F.shape[1]))
    for c, pi in enumerate(prior):
        k = present.index(c) if c in present else None
        latent = -pi * F[0].astype(float) if k is None else F[2 + k].astype(float)
        z = F[1].astype(float) if k is None else F[2 + P + k].astype(float)
        vote = 0 if k is None else F[3 + 2 * P + k].astype(float)
        w_i, w_l, w_v = model.powers
        log_p[c] += w_i * np.log(np.maximum(latent + pi, 0) + model.delta * pi)
        log_p[c] += w_l * (np.log(pi) + z) + w_v * np.log(vote + model.v_0 * pi)
    p = np.exp(log_p - log_p.max(axis=0))
    return np.asarray((p / p.sum(axis=0)).T)


def found(F: NDArray[np.float32], present: list[int], model: BlockModel, n_classes: int) -> NDArray[np.float32]:
    P, m = len(present), F.shape[1]
    p, link = np.full((P + 1, m), np.nan, np.float32), model.link(n_classes)
    class_probabilities(F, np.array(present, np.int16), m, link, p)
    full = p[P][:, None] * link.power
    full[:, present] = p[:P].T
    return np.asarray(full)


def latent_values(rng: np.random.Generator, P: int, m: int) -> NDArray[np.float32]:
    F = rng.normal(size=(3 + 3 * P, m))
    F[2 + 2 * P :] = rng.gamma(0.5, 4, (P + 1, m))
    return F.astype(np.float32)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.sampled_from([0.3, 1.0, 4.0]))
@settings(deadline=None, max_examples=60)
def test_pool(seed: int, n_classes: int, power: float) -> None:
    rng = np.random.default_rng(seed)
    weights = power * rng.random(3) * (rng.random(3) < 0.7) + [0, 0, 0.01]
    prior = rng.dirichlet(np.full(n_classes, 2.0)) + 1e-4
    model = BlockModel(weights=tuple(weights), prior=tuple(prior), delta=rng.uniform(0.001, 0.1))
    present = np.flatnonzero(rng.random(n_classes) < 0.6).tolist()
    F = latent_values(rng, len(present), 9)
    np.testing.assert_allclose(
        found(F, present, model, n_classes), pooled(F, present, model, n_classes), atol=2e-4
    )


def test_all_of_many_classes_under_a_sharp_pool() -> None:
    """What an absent class would get must not drown the classes when none is absent."""
    present, F = list(range(20)), np.zeros((63, 1), np.float32)
    F[22:42, 0] = np.linspace(0, 0.2, 20)  # the classes' log-ratios
    model = BlockModel(weights=(0.0, 30.0, 0.0))
    np.testing.assert_allclose(found(F, present, model, 20), pooled(F, present, model, 20), atol=1e-3)


def field_of(model: BlockModel, classes: list[int], labelled: float) -> tuple[Field, NDArray[np.float64]]:
    """Soft labels of some classes; what they leave to no class, all or a part of 1 - `labelled`."""
    points, _ = street(0, 900, C)
    rng = np.random.default_rng(1)
    weights = np.zeros((900, C + model.other), np.float32)
    weights[:, classes] = labelled * rng.dirichlet(np.full(len(classes), 0.4), 900)
    if model.other:
        weights[:, C] = 1 - labelled
    field = Field(model, C)
    field.add(Observations(points, None, weights, featureless(900)))
    return field, np.concatenate([points[:100] + 0.02, [[500.0, 0, 0]]])


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("classes", [[0, 1, 2, 3], [1, 3], [2]], ids=str)
@pytest.mark.parametrize("labelled", [1.0, 0.7])
def test_answers(name: str, classes: list[int], labelled: float) -> None:
    field, points = field_of(MODELS[name], classes, labelled)
    found = field.query(points, featureless(101))
    pairs = pairs_of(field, points, MODEL.blend / 2)
    expected = blended(field, pairs, 101, featureless(101))
    assert found.probability.shape == (101, C)
    np.testing.assert_allclose(found.variance, expected.variance, atol=3e-4)
    np.testing.assert_allclose(found.probability, expected.probability, atol=1e-3)
    np.testing.assert_allclose(found.probability.sum(axis=1), 1, atol=1e-5)


def test_no_rate_no_errors() -> None:
    plain, points = field_of(MODEL, [0, 1, 2], 1.0)
    same, _ = field_of(replace(MODEL, errors=(0.1, 0.2, 0.3, 0.4), error_power=2.0), [0, 1, 2], 1.0)
    for a, b in zip(plain.query(points, featureless(101)), same.query(points, featureless(101))):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("name", MODELS)
def test_far_away_the_prior_of_the_classes_is_all_there_is(name: str) -> None:
    """Less the mass of no class, and with the errors' share: the formula of the link without data."""
    model = MODELS[name]
    field, points = field_of(model, [0, 1], 0.7)
    found = field.query(points, featureless(101))
    p = model.class_prior(C).astype(np.float64) ** sum(model.powers)
    expected = less_errors(model, p[None] / p.sum(), C)[0]
    np.testing.assert_allclose(found.probability[-1], expected, atol=1e-6)
    np.testing.assert_allclose(prior_probabilities(model.link(C), C), expected, atol=1e-6)
    assert found.probability[-1].sum() == pytest.approx(1, abs=1e-6)
    assert found.variance[-1] == pytest.approx(field.prior_variance)


def test_a_plain_pool_without_data_is_the_prior_to_the_sum_of_the_powers() -> None:
    model = replace(MODEL, weights=(1.0, 0.5, 0.5))
    expected = np.array([16, 9, 4, 1]) / 30
    np.testing.assert_allclose(prior_probabilities(model.link(C), C), expected, atol=1e-6)
    with_other = replace(model, other=True, prior=None)  # every column alike
    np.testing.assert_allclose(prior_probabilities(with_other.link(C), C), 0.25, atol=1e-6)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.booleans(), st.sampled_from([0.0, 0.3, 2.0]))
@settings(deadline=None, max_examples=40)
def test_without_data(seed: int, n_classes: int, other: bool, error_rate: float) -> None:
    rng = np.random.default_rng(seed)
    model = BlockModel(
        weights=tuple(4 * rng.random(3) * (rng.random(3) < 0.7) + [0, 0, 0.01]),
        prior=tuple(rng.dirichlet(np.full(n_classes, 2.0)) + 1e-3), errors=tuple(rng.uniform(0.1, 1, n_classes)),
        other=other, error_rate=error_rate, error_power=rng.uniform(0.3, 1.5),
    )  # fmt: skip
    found = prior_probabilities(model.link(n_classes), n_classes)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, unknown(model, n_classes), atol=1e-4)


WIDE = {
    **MODELS,
    **{name: replace(MODEL, posterior=name, weights=CLOSED[name]) for name in CLOSED},
    "sharp": replace(MODEL, weights=(2.0, 1.0, 0.5)),
    "sharp, errors by other": replace(MODELS["errors by other"], weights=(2.0, 1.0, 0.5)),
}


@pytest.mark.parametrize("name", WIDE)
def test_far_from_members_a_block_s_answer_is_that_of_no_block(name: str) -> None:
    """Members in a corner of a cell, and points many length scales off: in the cell, next to it, and beyond."""
    model = replace(WIDE[name], kernel=Matern52(ell=(0.02,), sf=0.7))
    rng = np.random.default_rng(2)
    field = Field(model, C)
    weights = 0.8 * rng.dirichlet(np.full(3, 0.4), 40)[:, [0, 1, 2, 2]] * (1, 1, 1, 0)
    field.add(Observations(rng.uniform(0.05, 0.5, (40, 3)), None, weights.astype(np.float32), featureless(40)))
    edge = 64 * model.resolution
    line = np.linspace((2.0, 2.0, 2.0), (3 * edge, 2.5, 2.2), 400)  # a cell, one without sites, one without blocks
    found = field.query(line, featureless(400))
    home = field.home(line)[0]
    assert home[0] >= 0
    assert home[200] >= 0
    assert home[-1] < 0
    np.testing.assert_allclose(found.probability, np.tile(found.probability[-1], (400, 1)), atol=2e-6)
    np.testing.assert_allclose(found.variance, field.prior_variance, rtol=2e-6)
    np.testing.assert_allclose(found.probability[-1], unknown(model, C), atol=2e-6)


@pytest.mark.parametrize("present", [[], [3], [0, 2, 5, 19]], ids=str)
def test_some_of_many_classes_under_a_sharp_pool(present: list[int]) -> None:
    F = np.zeros((3 + 3 * len(present), 1), np.float32)
    F[2 + len(present) : 2 + 2 * len(present), 0] = np.linspace(0, 0.2, len(present))
    model = BlockModel(weights=(0.0, 30.0, 0.0))
    np.testing.assert_allclose(found(F, present, model, 20), pooled(F, present, model, 20), atol=1e-3)


@pytest.mark.parametrize(
    "settings",
    [{"error_rate": -0.1}, {"error_rate": np.nan}, {"error_power": 0.0}, {"error_power": np.inf},
     {"errors": (0.5, 0.0)}, {"errors": ()}, {"errors": (1.0, np.nan)},
     {"posterior": "laplace", "other": True}, {"posterior": "dirichlet", "error_rate": 0.1}],
    ids=str,
)  # fmt: skip
def test_invalid_settings(settings: dict[str, object]) -> None:
    with pytest.raises(InputError):
        BlockModel(**settings)  # type: ignore[arg-type]


def test_errors_for_other_classes() -> None:
    with pytest.raises(InputError, match="errors is for 3 classes, the map has 4"):
        Field(replace(MODEL, errors=(0.2, 0.3, 0.5)), C)


def test_error_frequencies() -> None:
    """Two members of classes 0 and 2; the points beside the second err once, to class 1."""
    X = np.array([[0, 5], [0, 0], [0, 0]], dtype=np.float32)
    Y = np.array([[0, 1, 5, 4], [0, 0, 0, 0], [0, 0, 0, 0]], dtype=np.float32)
    mass = np.array([[2, 0.5], [1, 3], [9, 0]], dtype=np.float32)  # the third row: of no class
    label = np.array([0, 0, 2, 1], dtype=np.int32)
    S, SY = np.empty((0, 2), np.float32), np.empty((0, 4), np.float32)
    patch = Patch(X, S, np.ones(2, np.float32), np.array([0, 2, 3], np.int16), mass, Y, SY, label)
    assert error_frequencies([patch], 3) == pytest.approx([1 / 6, 1 / 2 + 1 / 6, 1 / 6])
    right = patch._replace(label=np.array([0, 0, 2, 2], np.int32))
    assert error_frequencies([right], 3) == pytest.approx([1 / 3] * 3)
