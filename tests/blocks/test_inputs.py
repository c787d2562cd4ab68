"""From labelled clouds to sites: features by name, labels of both kinds, and what is refused."""

import numpy as np
import pytest

from semgp.blocks.accumulate import FEATURE_UNIT, MASS_UNIT
from semgp.blocks.field import Field
from semgp.blocks.inputs import add_cloud, cloud_features
from semgp.blocks.model import BlockModel
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError

TWO = Classes(("road", "grass"))
COLOURS = np.array([[0, 51, 255], [255, 0, 102]], dtype=np.uint8)
LABELS = np.array([0, 1], dtype=np.int32)
POINTS = np.array([[0.1, 0.2, 0.3], [1.1, 1.2, 1.3]])
CLOUD = LabelledCloud(
    POINTS, TWO, LABELS, colours=COLOURS, features=np.array([[1.5, -2.0], [0.25, 7.0]]),
    feature_names=("intensity", "height"),
)  # fmt: skip


def test_features_by_name() -> None:
    found = cloud_features(CLOUD, ("height", "blue", "intensity", "red"))
    expected = np.array([[-2, 1, 1.5, 0], [7, 0.4, 0.25, 1]], dtype=np.float32)
    np.testing.assert_array_equal(found, expected)
    assert cloud_features(CLOUD, ()).shape == (2, 0)


def test_a_feature_called_red_comes_before_the_colour() -> None:
    cloud = LabelledCloud(POINTS, TWO, LABELS, colours=COLOURS, features=np.ones((2, 1)), feature_names=("red",))
    np.testing.assert_allclose(cloud_features(cloud, ("red", "green")), [[1.0, 0.2], [1.0, 0.0]])


@pytest.mark.parametrize(
    ("cloud", "known"),
    [
        (CLOUD, "intensity, height, red, green, blue"),
        (LabelledCloud(POINTS, TWO, LABELS, features=np.ones((2, 1))), "feature 0"),
        (LabelledCloud(POINTS, TWO, LABELS), "none"),
    ],
    ids=["all", "features", "nothing"],
)
def test_missing_features_are_named(cloud: LabelledCloud, known: str) -> None:
    with pytest.raises(InputError, match=f"'normal', the cloud has: {known}"):
        cloud_features(cloud, ("normal",))
    field = Field(BlockModel(features=("normal",)), 2)
    with pytest.raises(InputError, match="normal"):
        add_cloud(field, cloud)
    assert len(field.sites) == 0


def test_features_reach_the_sites() -> None:
    field = Field(BlockModel(features=("height",)), 2)
    add_cloud(field, CLOUD)
    mass = field.sites.mass.sum(axis=1)
    np.testing.assert_allclose(field.sites.place[:, 3] / mass / FEATURE_UNIT, [-2, 7])


def test_points_without_labels_are_left_out() -> None:
    field = Field(BlockModel(), 2)
    add_cloud(field, LabelledCloud(POINTS, TWO, np.array([-1, 1], np.int32)))
    assert field.sites.mass.tolist() == [[0, MASS_UNIT]]
    np.testing.assert_allclose(field.sites.positions, POINTS[1:], atol=1e-8)


@pytest.mark.parametrize(
    "cloud",
    [
        LabelledCloud(POINTS, TWO),
        LabelledCloud(POINTS, TWO, np.full(2, -1, np.int32)),
        LabelledCloud(POINTS, TWO, weights=np.zeros((2, 2))),
        LabelledCloud(np.empty((0, 3)), TWO, np.empty(0, np.int32)),
    ],
    ids=["no labels", "missing labels", "no weight", "no points"],
)
def test_clouds_without_labels_change_nothing(cloud: LabelledCloud) -> None:
    field = Field(BlockModel(), 2)
    add_cloud(field, cloud)
    assert len(field.sites) == 0
    add_cloud(field, CLOUD)
    before = field.sites.mass.copy()
    field.solve()
    add_cloud(field, cloud)
    np.testing.assert_array_equal(field.sites.mass, before)
    assert field.solve() == 0


def test_soft_labels_keep_their_weights() -> None:
    field = Field(BlockModel(), 2)
    add_cloud(field, LabelledCloud(POINTS, TWO, weights=np.array([[0.25, 0.5], [0, 3]])))
    assert (field.sites.mass / MASS_UNIT).tolist() == [[0.25, 0.5], [0, 3]]


def test_what_soft_labels_leave_is_the_mass_of_no_class() -> None:
    field = Field(BlockModel(other=True), 2)
    add_cloud(field, LabelledCloud(POINTS, TWO, weights=np.array([[0.25, 0.5], [0, 1]])))
    assert (field.sites.mass / MASS_UNIT).tolist() == [[0.25, 0.5, 0.25], [0, 1, 0]]


def test_hard_labels_leave_nothing() -> None:
    field = Field(BlockModel(other=True), 2)
    add_cloud(field, CLOUD)
    assert (field.sites.mass / MASS_UNIT).tolist() == [[1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize("raw", [3e7, -3.01e4, 2.9e4, -2.9e4])
def test_huge_features_are_refused(raw: float) -> None:
    """Intensities in raw units, for example: sums of whole steps must not run over."""
    cloud = LabelledCloud(
        np.full((40, 3), 0.01), TWO, np.zeros(40, np.int32), features=np.full((40, 1), raw), feature_names=("raw",)
    )
    field = Field(BlockModel(features=("raw",)), 2)
    if abs(raw) > 3e4:
        with pytest.raises(InputError, match="scale them"):
            add_cloud(field, cloud)
        assert field.sites.origin is None
        return
    for _ in range(30):
        add_cloud(field, cloud)
    mass = field.sites.mass.sum(axis=1)
    np.testing.assert_allclose(field.sites.place[:, 3] / mass / FEATURE_UNIT, raw)


def test_heavy_labels_are_refused() -> None:
    field = Field(BlockModel(), 2)
    with pytest.raises(InputError, match="64 at most"):
        add_cloud(field, LabelledCloud(POINTS, TWO, weights=np.array([[65.0, 0], [1, 1]])))
    assert field.sites.origin is None
