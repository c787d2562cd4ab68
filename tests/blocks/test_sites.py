"""Sites against a dictionary of voxels with whole numbers of any size."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.blocks.accumulate import FEATURE_UNIT, MASS_UNIT, PLACE_UNIT
from semgp.blocks.cells import CELL, cell_keys
from semgp.blocks.observations import Observations
from semgp.blocks.sites import Sites
from tests.blocks.naive import Array, featureless, voxel_index
from tests.blocks.site_sums import Voxels, made, voxels

F32 = NDArray[np.float32]


def expected(points: Array, weights: F32, features: F32, resolution: float) -> Voxels:
    found: Voxels = {}
    for p, w, f in zip(points / resolution, weights, features):
        mass = [round(float(v) * MASS_UNIT) for v in w]
        place = [*((p - np.floor(p)) * PLACE_UNIT), *(f.astype(np.float64) * FEATURE_UNIT)]
        if sum(mass):
            old = found.get(key := tuple(np.floor(p).astype(int).tolist()), ([0] * len(w), [0] * len(place)))
            moved = [a + sum(mass) * round(float(b)) for a, b in zip(old[1], place)]
            found[key] = [a + b for a, b in zip(old[0], mass)], moved
    return found


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.0, -3.0, 5e6]),
    st.sampled_from([0.05, 0.2, 1 / 3]),
    st.integers(1, 5),
)
@settings(deadline=None, max_examples=40)
def test_any_order_and_any_parts_give_the_same(seed: int, shift: float, resolution: float, parts: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 120))
    points = rng.uniform(0, rng.choice([0.3, 3.0, 40.0]), (n, 3)) + shift * np.array([1, -1, 0.5])
    weights = (rng.random((n, 3)) * rng.choice([0, 1e-4, 1, 30], (n, 3))).astype(np.float32)
    features = rng.normal(scale=20, size=(n, 2)).astype(np.float32)
    want = expected(points, weights, features, resolution)
    assert voxels(made(points, weights, features, resolution)) == want
    shuffled = rng.permutation(n)
    sites = made(points[shuffled], weights[shuffled], features[shuffled], resolution, parts)
    assert voxels(sites) == want
    if want:
        assert np.array_equal(np.sort(sites.voxels.keys), sites.voxels.keys[np.lexsort(_columns(sites))])


def _columns(sites: Sites) -> NDArray[np.int64]:
    return voxel_index(sites.voxels.keys).T[::-1]


def test_hard_labels_are_soft_ones_of_weight_one() -> None:
    rng = np.random.default_rng(0)
    points, labels = rng.uniform(0, 4, (300, 3)), rng.integers(0, 5, 300).astype(np.int32)
    features = rng.normal(size=(300, 1)).astype(np.float32)
    hard = Sites(5, 1, 0.4)
    touched = hard.add(Observations(points, labels, None, features))
    soft = made(points, np.eye(5, dtype=np.float32)[labels], features, 0.4)
    assert touched.tolist() == list(range(len(hard.cells)))
    for name, array in soft.to_arrays().items():
        np.testing.assert_array_equal(hard.to_arrays()[name], array)
    np.testing.assert_allclose(hard.drift, soft.drift)


@pytest.mark.parametrize("shift", [0.0, 5e6])
def test_positions_are_weighted_means(shift: float) -> None:
    points = np.array([[0.01, 0.02, 0.03], [0.04, 0.02, 0.01], [-0.01, 0.02, 0.01]]) + shift
    sites = made(points, np.array([[3, 0], [0, 1], [1, 1]], np.float32), featureless(3), 0.05)
    mean = (3 * points[0] + points[1]) / 4
    np.testing.assert_allclose(sites.positions, [mean, points[2]], atol=1e-8 if shift == 0 else 2e-9)


def test_chains_hold_each_cell_s_sites() -> None:
    rng = np.random.default_rng(1)
    sites = Sites(2, 0, 0.1)
    for _ in range(4):
        touched = sites.add(
            Observations(rng.uniform(-9, 9, (40, 3)), np.zeros(40, np.int32), None, featureless(40))
        )
        assert (np.diff(touched) > 0).all()
    index = voxel_index(sites.voxels.keys)
    np.testing.assert_array_equal(voxel_index(cell_keys(sites.voxels.keys)), index // CELL * CELL)
    for cell in range(len(sites.cells)):
        chain, s = [], sites.head[cell]
        while s >= 0:
            chain.append(s)
            s = sites.next[s]
        mine = np.flatnonzero((index // CELL * CELL == voxel_index(sites.cells.keys[cell : cell + 1])).all(axis=1))
        assert sorted(chain) == mine.tolist()
        assert sites.size[cell] == len(mine)


def test_cells_are_aligned_to_the_world() -> None:
    sites = made(np.array([[7.3, -100.2, 0.0]]), np.ones((1, 1), np.float32), featureless(1), 0.05)
    assert sites.origin is not None
    assert (sites.origin % CELL == 0).all()


def test_weights_that_round_to_nothing_are_no_sites() -> None:
    assert len(made(np.zeros((1, 3)), np.full((1, 4), 1e-4, np.float32), featureless(1), 0.1)) == 0


def test_drift_says_how_much_a_cell_has_changed() -> None:
    sites = Sites(2, 0, 0.1)
    point, one = np.zeros((1, 3)), np.zeros(1, np.int32)
    expected_drift = 0.0
    for label, step in ((0, 1.0), (0, 0.5 / 2), (1, 1.5 / 3), (1, (1.5 - 1 / 3) / 4)):
        sites.add(Observations(point, one + label, None, featureless(1)))
        expected_drift += step
        assert sites.drift[0] == pytest.approx(expected_drift)
