"""Settings of forgetting, and their JSON."""

import json
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest

from semgp.errors import InputError
from semgp.gp.model import GPModel
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from tests.maps.forgetting.scenes import MODEL, NEVER, TWO


class TestSettings:
    @pytest.mark.parametrize(
        "bad",
        [
            {"half_life": 0.0}, {"half_life": -1.0}, {"half_life": np.nan}, {"half_life": np.inf},
            {"half_life": "1"},
            {"passed": 0.0}, {"passed": -0.5}, {"passed": 1.01}, {"passed": np.nan},
            {"per": "minute"}, {"per": None},
        ],
        ids=str,
    )  # fmt: skip
    def test_out_of_range(self, bad: dict[str, Any]) -> None:
        with pytest.raises(InputError, match=next(iter(bad)).replace("per", "per 'scan' or per 'second'")):
            Forgetting(**({"half_life": 5.0} | bad))

    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: GPSemanticMap(TWO, MODEL, forgetting=NEVER), "free=FreeSpace"),
            (lambda: GPSemanticMap(TWO, GPModel(), forgetting=NEVER), "BlockModel"),
            (lambda: GPSemanticMap(TWO, GPModel(), free=FreeSpace(), forgetting=NEVER), "BlockModel"),
        ],
    )
    def test_maps_that_cannot_forget(self, make: Callable[[], object], message: str) -> None:
        with pytest.raises(InputError, match=message):
            make()

    @pytest.mark.parametrize("forgetting", [Forgetting(3.0), Forgetting(0.5, "second", 0.125)])
    def test_json(self, forgetting: Forgetting) -> None:
        assert Forgetting.from_json(json.loads(json.dumps(forgetting.to_json()))) == forgetting

    def test_json_of_numpy_s_numbers(self) -> None:
        forgetting = Forgetting(cast("float", np.int64(3)), passed=cast("float", np.float32(0.25)))
        assert Forgetting.from_json(json.loads(json.dumps(forgetting.to_json()))) == Forgetting(3.0, passed=0.25)

    @pytest.mark.parametrize(
        "plain",
        [{}, {"half_life": 1, "colour": 3}, {"half_life": "1"}, {"half_life": 1, "passed": "x"}, [], None],
        ids=str,
    )
    def test_json_that_is_none(self, plain: Any) -> None:
        with pytest.raises(InputError, match=r"settings|half_life"):
            Forgetting.from_json(plain)
