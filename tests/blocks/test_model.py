"""The block model: what it refuses, what it fills in, and that nothing is lost in JSON."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from semgp.blocks.model import CLOSED, EXPERTS, BlockModel
from semgp.errors import InputError
from semgp.gp.kernels import Product
from semgp.gp.stationary import Matern12, Matern32, Matern52

MODELS = [
    BlockModel(),
    *(BlockModel(posterior=name) for name in (*CLOSED, *EXPERTS)),
    BlockModel(weights=(0.1, 0.0, 3.0), prior=(0.5, 0.2, 0.3), leaf=10, near=0, far=3, blend=8.0),
    BlockModel(kernel=Matern12((1.0, 2.0, 3.0, 4.0), 2.0) + Matern32((1.0,), dims=(3,)), features=("red",)),
]
INVALID: dict[str, dict[str, Any]] = {
    **{f"{name} {value}": {name: value}
       for name in ("resolution", "s_n", "nugget", "a", "delta", "v_0", "blend")
       for value in (0.0, -1.0, np.nan, np.inf)},
    "posterior": {"posterior": "median"},
    "two weights": {"weights": (1.0, 2.0)},
    "negative weight": {"weights": (1.0, -0.1, 0.0)},
    "no weight": {"weights": (0.0, 0.0, 0.0)},
    "infinite weight": {"weights": (np.inf, 0.0, 0.0)},
    "empty prior": {"prior": ()},
    "zero in prior": {"prior": (0.5, 0.0)},
    "NaN in prior": {"prior": (0.5, np.nan)},
    "leaf of one": {"leaf": 1},
    "negative near": {"near": -1},
    "negative far": {"far": -1},
    "too many members": {"leaf": 1000},
    "a leaf and a half": {"leaf": 48.5},
    "half a neighbour": {"near": 8.5},
    "far of None": {"far": None},
    "leaf of words": {"leaf": "64"},
    "whole floats": {"leaf": 64.0},
    "wide blend": {"blend": 8.1},
    "product": {"kernel": Product(Matern52((1.0,)), Matern52((1.0,)))},
    "no kernel": {"kernel": "matern"},
    "length scales": {"kernel": Matern52((1.0, 2.0))},
    "dimensions": {"kernel": Matern52((1.0,), dims=(0, 3))},
    "negative dimension": {"kernel": Matern52((1.0,), dims=(0, -1))},
    "no dimensions": {"kernel": Matern52((1.0,), dims=())},
    "dimensions of a feature": {"kernel": Matern52((1.0,), dims=(4,)), "features": ("red",)},
    "length scales for a feature that is none": {"kernel": Matern52((1.0, 2.0, 3.0, 4.0))},
    "dimensions of the second term": {"kernel": Matern52((1.0,)) + Matern32((1.0,), dims=(3,))},
    "features in one word": {"features": "red"},
    "length scales for features": {"kernel": Matern52((1.0, 1.0, 1.0)), "features": ("red",)},
}  # fmt: skip


@pytest.mark.parametrize("settings", INVALID.values(), ids=INVALID.keys())
def test_invalid_settings_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        BlockModel(**settings)


@pytest.mark.parametrize("model", MODELS, ids=str)
def test_round_trip_through_json(model: BlockModel) -> None:
    assert BlockModel.from_json(json.loads(json.dumps(model.to_json()))) == model


def test_missing_fields_are_refused() -> None:
    whole = BlockModel(prior=(0.5, 0.5)).to_json()

    def is_refused(name: str) -> bool:
        try:
            BlockModel.from_json({key: value for key, value in whole.items() if key != name})
        except InputError:
            return True
        return False

    assert [name for name in whole if not is_refused(name)] == []


@pytest.mark.parametrize(
    "damage",
    [{"colour": 1}, {"kernel": 3}, {"kernel": {"name": "Cosine"}}, {"weights": None}, {"s_n": "much"},
     {"leaf": "8"}, {"leaf": 8.0}, {"features": 1}, {"features": "red"}, {"prior": "xy"}, {"prior": "12"},
     {"weights": "123"}, {"posterior": []}, {"error_rate": None}, {"error_power": "high"}, {"blend": None},
     {"other": "no"}],
    ids=str,
)  # fmt: skip
def test_damaged_json_is_refused(damage: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        BlockModel.from_json(BlockModel().to_json() | damage)


@pytest.mark.parametrize("name", CLOSED)
def test_posteriors_name_their_powers(name: str) -> None:
    model = BlockModel(posterior=name)
    assert model.powers == CLOSED[name]
    assert model.solves == (name != "vote")
    assert BlockModel(posterior=name, weights=(0.0, 2.0, 1.0)).powers == (0.0, 2.0, 1.0)


@pytest.mark.parametrize("name", EXPERTS)
def test_experts_do_not_solve_the_closed_form(name: str) -> None:
    assert not BlockModel(posterior=name).solves


def test_class_prior() -> None:
    np.testing.assert_allclose(BlockModel().class_prior(4), 0.25)
    model = BlockModel(prior=(2.0, 1.0, 1.0))
    np.testing.assert_allclose(model.class_prior(3), [0.5, 0.25, 0.25])
    model.fits(3)
    with pytest.raises(InputError, match="prior is for 3 classes, the map has 4"):
        model.fits(4)


def test_what_compiled_code_takes() -> None:
    model = BlockModel(weights=(0.5, 0.25, 1.0), prior=(0.8, 0.2), leaf=10, near=3, far=7, features=("red", "x"))
    assert model.sizes() == (10, 7, 20)
    assert model.n_dims == 5
    noise, link = model.noise(2), model.link(2)
    assert (noise.s_n, noise.nugget, noise.a, noise.solve) == (model.s_n, model.nugget, model.a, True)
    np.testing.assert_allclose(link.power, np.array([1.0, 0.25]) ** 1.75, rtol=1e-6)
    assert [float(w) for w in (link.indicator, link.log_ratio, link.vote)] == [0.5, 0.25, 1.0]


def test_models_are_values() -> None:
    model = BlockModel(weights=(1, 2, 3), prior=(1, 1))  # whole numbers are numbers too
    assert model == replace(model, weights=(1.0, 2.0, 3.0), prior=(1.0, 1.0))
    assert hash(model) == hash(replace(model))
