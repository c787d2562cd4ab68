"""Settings of free space, their model, and their JSON."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from semgp.blocks.model import BlockModel
from semgp.errors import InputError
from semgp.gp.model import GPModel
from semgp.maps.free_space import FreeSpace, occupancy_model
from semgp.maps.gp import GPSemanticMap
from tests.maps.free_space.scenes import EDGE, FREE_SPACE, MODEL, SIX, built, queries, room


class TestSettings:
    @pytest.mark.parametrize(
        "bad",
        [
            {"rays": 0}, {"rays": 2.5}, {"rays": "many"}, {"thin": 0}, {"thin": -1}, {"thin": 1.5},
            {"weight": 0.0}, {"weight": np.nan}, {"weight": -0.5}, {"weight": "1"}, {"weight": None},
            {"margin": 0.0}, {"margin": np.inf}, {"near": -1.0}, {"near": np.nan},
            {"reach": 0.0}, {"reach": -5.0}, {"reach": np.inf}, {"reach": np.nan}, {"reach": "far"},
            {"seed": -1}, {"seed": 0.5}, {"seed": None},
        ],
        ids=str,
    )  # fmt: skip
    def test_out_of_range(self, bad: dict[str, Any]) -> None:
        with pytest.raises(InputError, match=next(iter(bad))):
            FreeSpace(**bad)

    @pytest.mark.parametrize("bad", [{"weight": 1e7}, {"weight": 1e-5}, {"seed": 2**64}, {"thin": 2**64}], ids=str)
    def test_of_no_use(self, bad: dict[str, Any]) -> None:
        with pytest.raises(InputError, match=next(iter(bad))):
            FreeSpace(**bad)

    @pytest.mark.parametrize(
        "free",
        [
            FreeSpace(occupancy_model(0.2)),
            FreeSpace(BlockModel(resolution=EDGE, features=("red",))),
            FreeSpace(replace(occupancy_model(EDGE), other=True)),
        ],
        ids=["resolution", "features", "other"],
    )
    def test_models_that_do_not_fit(self, free: FreeSpace) -> None:
        with pytest.raises(InputError, match=r"occupancy_model\(resolution\)"):
            GPSemanticMap(SIX, MODEL, free=free)

    def test_a_prior_for_two_classes(self) -> None:
        three = FreeSpace(replace(occupancy_model(EDGE), prior=(0.2, 0.3, 0.5)))
        with pytest.raises(InputError, match="3 classes, the map has 2"):
            GPSemanticMap(SIX, MODEL, free=three)
        two = FreeSpace(replace(occupancy_model(EDGE), prior=(0.9, 0.1)))
        assert GPSemanticMap(SIX, MODEL, free=two).occupancy(queries(1)).probability[0] < 0.2

    def test_the_paper_s_map_keeps_no_free_space(self) -> None:
        with pytest.raises(InputError, match="BlockModel"):
            GPSemanticMap(SIX, GPModel(n_inducing=20), free=FREE_SPACE)

    @pytest.mark.parametrize("make", [lambda: built(room()[:1], free=None), lambda: GPSemanticMap(SIX, GPModel())])
    def test_maps_without_free_space_say_so(self, make: Callable[[], GPSemanticMap]) -> None:
        made = make()
        assert made.free is None
        for ask in (
            lambda: made.occupancy(queries(1)),
            lambda: made.free_positions,
            lambda: made.occupied_positions,
        ):
            with pytest.raises(InputError, match="free=FreeSpace"):
                ask()

    def test_the_default_model_goes_with_the_resolution(self) -> None:
        for resolution in (0.05, 1 / 3):
            filled = FREE_SPACE.of_resolution(resolution)
            assert filled.model == occupancy_model(resolution)
            assert filled.of_resolution(resolution) == filled
            a, b = (occupancy_model(r).kernel.diag(np.zeros((1, 3))) for r in (resolution, 1.0))
            np.testing.assert_allclose(a, b)
            X = np.random.default_rng(0).normal(size=(9, 3))
            np.testing.assert_allclose(
                occupancy_model(resolution).kernel(X * resolution, X * resolution),
                occupancy_model(1.0).kernel(X, X),
            )

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_along_the_vertical_lengths_are_shorter(self, axis: int) -> None:
        kernel = occupancy_model(0.2, vertical=axis).kernel
        k = kernel(np.eye(3), np.zeros((1, 3)))[:, 0]
        assert np.argmin(k) == axis
        assert k[axis - 1] == k[axis - 2] == occupancy_model(0.2).kernel(np.eye(3), np.zeros((1, 3)))[0, 0]
        far = kernel(np.eye(3) * 2.0, np.zeros((1, 3)))[:, 0]
        assert far[axis] < 0.2 * far[axis - 1]

    @pytest.mark.parametrize(
        "free",
        [FREE_SPACE, FreeSpace(occupancy_model(0.2, 1), 5, 0.3, 2.0, 4.0, 2, 30.0, 7)],
        ids=["plain", "all"],
    )
    def test_json(self, free: FreeSpace) -> None:
        assert FreeSpace.from_json(json.loads(json.dumps(free.to_json()))) == free

    def test_json_of_numpy_s_numbers(self) -> None:
        free = FreeSpace(weight=cast("float", np.float32(0.25)), margin=cast("float", np.int64(2)))
        assert FreeSpace.from_json(json.loads(json.dumps(free.to_json()))) == FreeSpace(weight=0.25, margin=2.0)

    @pytest.mark.parametrize(
        "plain",
        [
            {},
            {"rays": 5},
            {"model": None, "colour": 3},
            {"model": None, "rays": -1},
            {"model": 3},
            [],
            None,
            "free",
        ],
        ids=str,
    )
    def test_json_that_is_none(self, plain: Any) -> None:
        with pytest.raises(InputError, match=r"settings|rays|model"):
            FreeSpace.from_json(plain)
