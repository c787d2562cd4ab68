"""What is promised of pooled answers, and what is refused."""

import math
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.maps.pooling import Weights, fuse_predictions
from semgp.prediction import OccupancyPrediction, Prediction
from tests.maps.pooling.answers import prediction

Array = NDArray[np.float64]


class TestFusePredictions:
    @pytest.mark.parametrize("weights", ["robust", "one"])
    @pytest.mark.parametrize("prior_variance", [None, 1.0])
    def test_one_answer_alone_stays_as_it_is(self, weights: Weights, prior_variance: float | None) -> None:
        alone = prediction([[0.7, 0.2, 0.1], [0.2, 0.2, 0.6]], variance=[[0.3], [1.0]])
        silent = prediction([[0.1, 0.1, 0.8]] * 2, observed=False, variance=0.01)
        for answers in ([alone], [alone, silent], [silent, alone, silent]):
            fused = fuse_predictions(answers, prior=[1, 2, 3], prior_variance=prior_variance, weights=weights)
            np.testing.assert_allclose(fused.probability, alone.probability)
            assert fused.observed.all()
            if fused.variance is not None:
                np.testing.assert_allclose(fused.variance, cast("Array", alone.variance))

    @pytest.mark.parametrize("weights", ["robust", "one"])
    def test_nobody_has_observed_it(self, weights: Weights) -> None:
        unknown = OccupancyPrediction(np.array([0.9]), np.array([False]))
        silent = prediction([[0.1, 0.9]], observed=False, variance=0.1, occupancy=unknown)
        fused = fuse_predictions(
            [silent, silent], prior=[3, 1], prior_variance=2.0, prior_occupancy=0.25, weights=weights
        )
        np.testing.assert_allclose(fused.probability, [[0.75, 0.25]])
        np.testing.assert_allclose(cast("Array", fused.variance), 2.0)
        assert not fused.observed.any()
        assert fused.label.tolist() == [-1]
        assert fused.occupancy is not None
        np.testing.assert_allclose(fused.occupancy.probability, [0.25])
        assert fused.occupancy.state.tolist() == [-1]

    def test_agreement_makes_sure_only_if_data_are_independent(self) -> None:
        answer = prediction([[0.8, 0.2]], variance=0.1)
        once = fuse_predictions([answer] * 3, prior_variance=1.0)
        thrice = fuse_predictions([answer] * 3, prior_variance=1.0, weights="one")
        np.testing.assert_allclose(once.probability, answer.probability)
        np.testing.assert_allclose(thrice.probability, [[0.8**3 / (0.8**3 + 0.2**3), 0.2**3 / (0.8**3 + 0.2**3)]])
        assert once.variance is not None
        assert thrice.variance is not None
        assert thrice.variance[0, 0] < once.variance[0, 0] == pytest.approx(0.1)

    def test_who_knows_more_decides(self) -> None:
        sure, unsure = prediction([[0.7, 0.3]], variance=0.1), prediction([[0.1, 0.9]], variance=0.85)
        assert fuse_predictions([sure, unsure], prior_variance=1.0).label.tolist() == [0]
        assert fuse_predictions([sure, unsure], prior_variance=1.0, weights="one").label.tolist() == [1]
        flat = prediction([[0.45, 0.55]])
        assert fuse_predictions([sure, flat]).label.tolist() == [0]

    @pytest.mark.parametrize("weights", ["robust", "one"])
    def test_certainties_that_contradict_each_other(self, weights: Weights) -> None:
        zero, one = prediction([[1.0, 0.0]], variance=0.0), prediction([[0.0, 1.0]], variance=0.0)
        fused = fuse_predictions([zero, one], prior_variance=1.0, weights=weights)
        np.testing.assert_allclose(fused.probability, 0.5)
        np.testing.assert_allclose(cast("Array", fused.variance), 0.0, atol=1e-11)

    def test_variances_of_different_priors_give_weights_but_no_variance(self) -> None:
        sure, unsure = prediction([[0.7, 0.3]], variance=1.0), prediction([[0.1, 0.9]], variance=0.9)
        fused = fuse_predictions([sure, unsure], prior_variance=[[10.0], [1.0]])
        assert fused.variance is None
        assert fused.label.tolist() == [0]

    def test_nothing_asked(self) -> None:
        assert len(fuse_predictions([prediction(np.empty((0, 3)))] * 2)) == 0

    @pytest.mark.parametrize(
        ("answers", "how", "message"),
        [
            ([], {}, "one member at least"),
            ([prediction([0.5, 0.5]), prediction([0.2, 0.3, 0.5])], {}, "classes differ"),
            ([prediction([0.5, 0.5]), prediction([[0.5, 0.5]] * 2)], {}, r"same points, not at \[1, 2\]"),
            ([prediction([0.5, 0.5])], {"weights": "two"}, "'robust' or 'one', not 'two'"),
            ([prediction([0.5, 0.5])], {"prior": [0.5, 0.0]}, "prior must be positive"),
            ([prediction([0.5, 0.5])], {"prior": [1, 1, 1]}, r"prior must .* shape \(2,\), not \(3,\)"),
            ([prediction([0.5, 0.5])], {"prior_variance": math.nan}, "prior_variance must be positive and finite"),
            ([prediction([0.5, 0.5])], {"prior_variance": np.ones((3, 2))}, r"shape \(1, 2\), not \(3, 2\)"),
            ([prediction([0.5, 0.5])], {"prior_variance": "much"}, "array of numbers"),
        ],
    )
    def test_bad_input(self, answers: list[Prediction], how: dict[str, Any], message: str) -> None:
        with pytest.raises(InputError, match=message):
            fuse_predictions(answers, **how)

    @pytest.mark.parametrize("prior", [0.0, 1.0, math.nan])
    def test_bad_prior_of_occupancy(self, prior: float) -> None:
        known = OccupancyPrediction(np.array([0.9]), np.array([True]))
        with pytest.raises(InputError, match="prior_occupancy"):
            fuse_predictions([prediction([0.5, 0.5], occupancy=known)], prior_occupancy=prior)
