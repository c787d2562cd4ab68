"""The share of errors, and the mass that labels leave to no class, against the formulas."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.field import Field
from semgp.blocks.learning import error_frequencies
from semgp.blocks.model import BlockModel
from semgp.blocks.patches import Patch
from semgp.errors import InputError
from tests.blocks.naive import blended, featureless, street

C = 4
MODEL = BlockModel(prior=(0.4, 0.3, 0.2, 0.1), leaf=20, near=6, far=10)
MODELS = {
    "errors": replace(MODEL, error_rate=0.4, errors=(0.1, 0.2, 0.3, 0.4)),
    "even errors": replace(MODEL, error_rate=2.0, error_power=1.3),
    "other": replace(MODEL, other=True),
    "errors by other": replace(MODEL, other=True, error_rate=0.7, errors=(4, 3, 2, 1)),
    "errors of a vote": replace(MODEL, posterior="vote", weights=(0, 0, 1), other=True, error_rate=0.7),
}


def field_of(model: BlockModel, classes: list[int], labelled: float) -> tuple[Field, NDArray[np.float64]]:
    """Soft labels of some classes; what they leave to no class, all or a part of 1 - `labelled`."""
    points, _ = street(0, 900, C)
    rng = np.random.default_rng(1)
    weights = np.zeros((900, C + model.other), np.float32)
    weights[:, classes] = labelled * rng.dirichlet(np.full(len(classes), 0.4), 900)
    if model.other:
        weights[:, C] = 1 - labelled
    field = Field(model, C)
    field.add(points, None, weights, featureless(900))
    return field, np.concatenate([points[:100] + 0.02, [[500.0, 0, 0]]])


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("classes", [[0, 1, 2, 3], [1, 3], [2]], ids=str)
@pytest.mark.parametrize("labelled", [1.0, 0.7])
def test_answers(name: str, classes: list[int], labelled: float) -> None:
    field, points = field_of(MODELS[name], classes, labelled)
    found = field.query(points, featureless(101))
    pairs = field.pairs(points, MODEL.blend / 2)
    expected = blended(field, pairs, 101, featureless(101))
    assert found.probability.shape == found.mean.shape == (101, C)
    np.testing.assert_allclose(found.probability, expected.probability, atol=1e-3)
    np.testing.assert_allclose(found.probability.sum(axis=1), 1, atol=1e-5)


def test_no_rate_no_errors() -> None:
    plain, points = field_of(MODEL, [0, 1, 2], 1.0)
    same, _ = field_of(replace(MODEL, errors=(0.1, 0.2, 0.3, 0.4), error_power=2.0), [0, 1, 2], 1.0)
    for a, b in zip(plain.query(points, featureless(101)), same.query(points, featureless(101))):
        np.testing.assert_array_equal(a, b)


def test_far_away_the_prior_of_the_classes_is_all_there_is() -> None:
    field, points = field_of(MODELS["errors by other"], [0, 1], 0.7)
    np.testing.assert_allclose(field.query(points, featureless(101)).probability[-1], MODEL.prior, atol=1e-6)


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
    patch = Patch(X, np.ones(2, np.float32), np.array([0, 2, 3], np.int16), mass, Y, label)
    assert error_frequencies([patch], 3) == pytest.approx([1 / 6, 1 / 2 + 1 / 6, 1 / 6])
    right = patch._replace(label=np.array([0, 0, 2, 2], np.int32))
    assert error_frequencies([right], 3) == pytest.approx([1 / 3] * 3)
