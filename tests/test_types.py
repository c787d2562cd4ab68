"""The types that travel: what they accept, what they refuse, what they say."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.prediction import OccupancyPrediction, Prediction

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


def posed(**fields: Any) -> LabelledCloud:
    rng = np.random.default_rng(0)
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.3, -0.5, 1.0]).as_matrix()
    T[:3, 3] = 4, -2, 1
    return LabelledCloud(rng.normal(scale=5, size=(20, 3)), Classes(("a",)), T_world_sensor=T, **fields)


def test_a_pose_covariance_moves_the_points_as_it_moves_the_pose() -> None:
    """Against the spread of the points over poses drawn from the covariance."""
    rng = np.random.default_rng(1)
    root = 1e-3 * rng.normal(size=(6, 6))
    cloud = posed(pose_covariance=root @ root.T)
    assert cloud.origin is not None
    draws = rng.normal(size=(40_000, 6)) @ root.T
    turned = Rotation.from_rotvec(draws[:, 3:])
    for i in (0, 7, 19):
        places = turned.apply(cloud.points[i] - cloud.origin) + cloud.origin + draws[:, :3]
        found = cloud.position_covariances
        assert found is not None
        assert np.allclose(found[i], np.cov(places.T), atol=0.04 * np.trace(found[i]))


def test_sensor_noise_adds_to_that_of_the_pose() -> None:
    noise = np.tile(np.diag([0.1, 0.2, 0.3]), (20, 1, 1))
    alone, both = posed(covariances=noise), posed(covariances=noise, pose_covariance=0.01 * np.eye(6))
    pose = posed(pose_covariance=0.01 * np.eye(6))
    assert posed().position_covariances is None
    assert alone.position_covariances is not None
    assert both.position_covariances is not None
    assert pose.position_covariances is not None
    assert np.array_equal(alone.position_covariances, noise)
    assert np.allclose(both.position_covariances, noise + pose.position_covariances)
    part = both[::3]
    assert part.position_covariances is not None
    assert np.allclose(part.position_covariances, both.position_covariances[::3])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"confidence": np.full(20, 1.5)}, "between 0"),
        ({"confidence": np.full(20, np.nan)}, "between 0"),
        ({"confidence": np.ones(3)}, r"shape \(20,\)"),
        ({"covariances": np.zeros((20, 3))}, r"shape \(20, 3, 3\)"),
        ({"covariances": np.full((20, 3, 3), np.inf)}, "NaN or infinite"),
        ({"covariances": np.tile(-np.eye(3), (20, 1, 1))}, "in 20 of 20 rows"),
        ({"covariances": np.tile(np.triu(np.ones((3, 3))), (20, 1, 1))}, "symmetric"),
        ({"pose_covariance": np.eye(3)}, r"shape \(6, 6\)"),
        ({"pose_covariance": np.diag([1, 1, 1, 1, 1, -1])}, "symmetric without negative eigenvalues"),
        ({"stamp": np.inf}, "stamp must be a time"),
    ],
)
def test_uncertainties_that_cannot_be(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        posed(**fields)


def test_occupancy_states() -> None:
    known = np.array([True, True, False])
    occupancy = OccupancyPrediction(np.array([0.9, 0.1, 0.9]), known)
    assert occupancy.state.tolist() == [1, 0, -1]
    assert np.allclose(occupancy.entropy, 0.325083, atol=1e-6)
    with pytest.raises(InputError, match="one shape"):
        OccupancyPrediction(np.ones(2), known)
    with pytest.raises(InputError, match="occupancy must be of 2 points"):
        Prediction(Classes(("a",)), np.ones((2, 1)), known[:2], occupancy=occupancy)
