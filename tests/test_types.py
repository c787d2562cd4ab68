"""The types that travel: what they accept, what they refuse, what they say."""

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.prediction import Prediction

TWO = Classes(("floor", "wall"))
POINTS = np.arange(12.0).reshape(4, 3)


class TestClasses:
    def test_names_colours_and_index(self) -> None:
        classes = Classes(("a", "b"), ((1, 2, 3), (4, 5, 6)))
        assert len(classes) == 2
        assert classes.index("b") == 1
        np.testing.assert_array_equal(classes.palette, [[1, 2, 3], [4, 5, 6]])
        assert Classes.numbered(3).names == ("class 0", "class 1", "class 2")

    def test_colours_left_out_differ(self) -> None:
        assert len(set(Classes.numbered(40).colours)) == 40

    @pytest.mark.parametrize(
        ("names", "colours", "message"),
        [
            ((), (), "at least one"),
            (("a", "b", "a"), (), "a occurs more than once"),
            (("a", "b"), ((0, 0, 0),), "2 class names but 1 colours"),
            (("a",), ((0, 0, 256),), "0 to 255"),
        ],
    )
    def test_bad_input(self, names: tuple, colours: tuple, message: str) -> None:  # type: ignore[type-arg]
        with pytest.raises(InputError, match=message):
            Classes(names, colours)

    def test_an_unknown_name_lists_the_known(self) -> None:
        with pytest.raises(InputError, match="'roof'; the classes are floor, wall"):
            TWO.index("roof")


class TestLabelledCloud:
    def test_hard_labels(self) -> None:
        cloud = LabelledCloud(POINTS, TWO, np.array([0, -1, 1, 1]))
        np.testing.assert_array_equal(cloud.labelled, [True, False, True, True])
        np.testing.assert_array_equal(cloud.class_weights, [[1, 0], [0, 0], [0, 1], [0, 1]])
        np.testing.assert_array_equal(cloud[cloud.labelled].hard_labels, [0, 1, 1])
        assert len(cloud[1:3]) == 2

    def test_soft_labels(self) -> None:
        cloud = LabelledCloud(POINTS, TWO, weights=np.array([[0.3, 0.7], [0, 0], [2, 1], [0, 1]]))
        np.testing.assert_array_equal(cloud.hard_labels, [1, -1, 0, 1])
        np.testing.assert_array_equal(cloud.labelled, [True, False, True, True])

    def test_no_labels(self) -> None:
        cloud = LabelledCloud(POINTS, TWO)
        assert not cloud.labelled.any()
        assert (cloud.hard_labels == -1).all()

    def test_an_empty_cloud_is_a_cloud(self) -> None:
        empty = LabelledCloud(np.empty((0, 3)), TWO, np.empty(0, dtype=int), features=np.empty((0, 2)))
        assert len(empty) == 0
        assert len(empty[empty.labelled]) == 0

    def test_large_coordinates_keep_their_digits(self) -> None:
        utm = POINTS * 1e-3 + (5e5, 5e6, 100.0)
        np.testing.assert_array_equal(LabelledCloud(utm, TWO).points, utm)

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"points": POINTS[:, :2]}, r"shape \(N, 3\), not \(4, 2\)"),
            (
                {"points": np.where(POINTS == 4, np.nan, POINTS)},
                "NaN or infinite values in 1 of 4 rows, first in row 1",
            ),
            ({"points": np.where(POINTS == 4, np.inf, POINTS)}, "isfinite"),
            ({"points": "here"}, "array of numbers"),
            ({"labels": np.zeros(3, int)}, r"shape \(4,\) to go with 4 points"),
            ({"labels": np.array([0, 1, 2, 0])}, "labels go from 0 to 2, but with 2 classes"),
            ({"labels": np.array([0, 1, -2, 0])}, "labels go from -2"),
            ({"labels": np.array([0.0, 1.0, 1.0, 0.0])}, "whole numbers"),
            ({"weights": np.ones((4, 3))}, r"shape \(4, 2\)"),
            ({"weights": -np.ones((4, 2))}, "must not be negative"),
            ({"weights": np.full((4, 2), np.nan)}, "NaN"),
            ({"labels": np.zeros(4, int), "weights": np.ones((4, 2))}, "not both"),
            ({"colours": np.zeros((3, 3))}, "colours must have shape"),
            ({"features": np.zeros((4, 2)), "feature_names": ("intensity",)}, "2 features but 1 feature names"),
            ({"T_world_sensor": np.eye(3)}, r"T_world_sensor must have shape \(4, 4\)"),
            ({"T_world_sensor": np.diag([2.0, 1, 1, 1])}, "no rigid transform"),
            ({"T_world_sensor": np.full((4, 4), np.nan)}, "NaN"),
            ({"T_world_sensor": np.diag([-1.0, 1, 1, 1])}, "no rigid transform"),
        ],
    )
    def test_bad_input(self, settings: dict, message: str) -> None:  # type: ignore[type-arg]
        with pytest.raises(InputError, match=message):
            LabelledCloud(**({"points": POINTS, "classes": TWO} | settings))


class TestPrediction:
    def test_label_confidence_entropy(self) -> None:
        p = np.array([[1.0, 0.0], [0.5, 0.5], [0.2, 0.8]])
        prediction = Prediction(TWO, p, np.array([True, False, True]))
        np.testing.assert_array_equal(prediction.label, [0, -1, 1])
        np.testing.assert_allclose(prediction.confidence, [1.0, 0.5, 0.8])
        np.testing.assert_allclose(prediction.entropy, [0, np.log(2), -0.2 * np.log(0.2) - 0.8 * np.log(0.8)])

    def test_shapes_must_agree(self) -> None:
        with pytest.raises(InputError, match="variance must have shape"):
            Prediction(TWO, np.ones((3, 2)) / 2, np.ones(3, bool), variance=np.ones((3, 1)))
