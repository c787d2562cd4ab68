"""What sites can hold, and what they refuse."""

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.blocks.accumulate import FEATURE_UNIT, MASS_UNIT
from semgp.blocks.observations import Observations
from semgp.blocks.sites import Sites
from semgp.errors import InputError
from tests.blocks.naive import Array, featureless
from tests.blocks.site_sums import made, voxels

F32 = NDArray[np.float32]


@pytest.mark.parametrize("weight", [64.001, 1024.5, 1e30, np.inf])
def test_weights_too_large(weight: float) -> None:
    weights = np.array([[1, 2], [0.5, weight]], np.float32)
    with pytest.raises(InputError, match="64 at most"):
        made(np.zeros((2, 3)), weights, featureless(2), 0.1)


@pytest.mark.parametrize("feature", [30_001.0, -30_001.0, np.inf, -3e38])
def test_features_too_large(feature: float) -> None:
    features = np.array([[1.0, 2.0], [0.0, feature]], np.float32)
    with pytest.raises(InputError, match="within 30000 of 0"):
        made(np.zeros((2, 3)), np.ones((2, 1), np.float32), features, 0.1)


def test_the_largest_weights_and_features_are_taken() -> None:
    sites = made(np.zeros((2, 3)), np.full((2, 3), 64, np.float32), np.array([[3e4], [-3e4]], np.float32), 0.1)
    assert sites.mass.tolist() == [[128 * MASS_UNIT] * 3]
    assert sites.place.tolist() == [[0, 0, 0, 0]]


def test_a_full_site_takes_no_more_labels() -> None:
    """A camera at rest puts a million labels into a voxel within minutes: sums never wrap round."""
    sites, step = Sites(1, 1, 0.1), 64 * MASS_UNIT
    point, features = np.array([[0.025, 0.05, 0.099]]), np.full((3000, 1), 3e4, np.float32)
    for _ in range(4):
        sites.add(Observations(np.tile(point, (3000, 1)), None, np.full((3000, 1), 64, np.float32), features))
    taken = 2**31 // step + 1  # the one that leads beyond 2^31 is the last
    assert sites.mass.tolist() == [[taken * step]]
    assert sites.mass.max() < 2**32
    np.testing.assert_allclose(sites.positions, point, atol=1e-8)
    assert sites.place[0, 3] == taken * step * 30_000 * FEATURE_UNIT
    before, drift = voxels(sites), sites.drift.copy()
    touched = sites.add(Observations(point, np.zeros(1, np.int32), None, features[:1]))
    assert touched.tolist() == [0]
    assert voxels(sites) == before
    np.testing.assert_array_equal(sites.drift, drift)
    sites.add(Observations(point + 0.1, np.zeros(1, np.int32), None, features[:1]))  # the next site is not full
    assert sites.mass.tolist() == [[taken * step], [MASS_UNIT]]


@pytest.mark.parametrize("soft", [False, True])
def test_what_is_full_is_the_mass_of_all_classes(soft: bool) -> None:
    almost = made(np.zeros((1, 3)), np.ones((1, 2), np.float32), featureless(1), 0.1).to_arrays()
    sites = Sites(2, 0, 0.1)
    sites.restore(almost | {"mass": np.array([[2**30, 2**30]], np.uint32)})
    one = None if soft else np.ones(1, np.int32)
    weights = np.array([[0, 1]], np.float32) if soft else None
    for _ in range(3):
        sites.add(Observations(np.zeros((1, 3)), one, weights, featureless(1)))
    assert sites.mass.tolist() == [[2**30, 2**30 + MASS_UNIT]]  # at 2^31 one more, beyond it none


@pytest.mark.parametrize("far", [1e9, 2e5])
def test_a_refused_update_leaves_no_trace(far: float) -> None:
    sites = Sites(1, 0, 0.1)
    with pytest.raises(InputError, match="away from where the map"):
        sites.add(Observations(np.array([[0.0, 0, 0], [far, 0, 0]]), np.zeros(2, np.int32), None, featureless(2)))
    assert_new(sites)
    elsewhere = np.array([[far + 1.0, 0, 0]])
    sites.add(Observations(elsewhere, np.zeros(1, np.int32), None, featureless(1)))
    np.testing.assert_allclose(sites.positions, elsewhere)


def assert_new(sites: Sites) -> None:
    assert sites.origin is None
    assert (len(sites), len(sites.voxels), len(sites.cells), len(sites.drift)) == (0, 0, 0, 0)
    assert sites.positions.shape == (0, 3)


REFUSED: dict[str, tuple[Array, F32, F32]] = {
    "far": (np.array([[0.0, 0, 0], [1e9, 0, 0]]), np.ones((2, 1), np.float32), np.zeros((2, 1), np.float32)),
    "heavy": (np.zeros((2, 3)), np.array([[1], [65]], np.float32), np.zeros((2, 1), np.float32)),
    "features": (np.zeros((2, 3)), np.ones((2, 1), np.float32), np.array([[0], [4e4]], np.float32)),
    "first far": (np.array([[1e300, 0, 0]]), np.ones((1, 1), np.float32), np.zeros((1, 1), np.float32)),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_updates(name: str) -> None:
    """The first leaves the sites as new, a later one as they were."""
    points, weights, features = REFUSED[name]
    sites = Sites(1, 1, 0.1)
    with pytest.raises(InputError):
        sites.add(Observations(points, None, weights, features))
    assert_new(sites)
    rng = np.random.default_rng(4)
    sites.add(Observations(rng.uniform(0, 9, (50, 3)), np.zeros(50, np.int32), None, np.ones((50, 1), np.float32)))
    before, cells, drift = voxels(sites), sites.cells.keys.copy(), sites.drift.copy()
    with pytest.raises(InputError):
        sites.add(Observations(points, None, weights, features))
    assert voxels(sites) == before
    np.testing.assert_array_equal(sites.cells.keys, cells)
    np.testing.assert_array_equal(sites.drift, drift)
