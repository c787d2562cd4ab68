"""Sites against a dictionary of voxels with whole numbers of any size."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.blocks.accumulate import FEATURE_UNIT, MASS_UNIT, PLACE_UNIT
from semgp.blocks.cells import CELL, cell_keys
from semgp.blocks.observations import Observations
from semgp.blocks.sites import Sites
from semgp.errors import InputError
from tests.blocks.naive import Array, featureless, voxel_index

F32 = NDArray[np.float32]
Voxels = dict[tuple[int, ...], tuple[list[int], list[int]]]


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


def voxels(sites: Sites) -> Voxels:
    if sites.origin is None:
        return {}
    index = voxel_index(sites.voxels.keys) + sites.origin
    rows = zip(index.tolist(), sites.mass.tolist(), sites.place.tolist())
    return {tuple(v): (mass, place) for v, mass, place in rows}


def made(points: Array, weights: F32, features: F32, resolution: float, parts: int = 1) -> Sites:
    sites = Sites(weights.shape[1], features.shape[1], resolution)
    for part in np.array_split(np.arange(len(points)), parts):
        sites.add(Observations(points[part], None, weights[part], features[part]))
    return sites


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


class TestStored:
    def sites(self) -> Sites:
        rng = np.random.default_rng(2)
        weights = rng.random((200, 3)).astype(np.float32)
        return made(rng.uniform(-9, 9, (200, 3)) + 5e6, weights, rng.normal(size=(200, 1)).astype(np.float32), 0.1)

    def test_round_trip(self) -> None:
        sites, again = self.sites(), Sites(3, 1, 0.1)
        again.restore({name: a.copy() for name, a in sites.to_arrays().items()})
        assert voxels(again) == voxels(sites)
        np.testing.assert_array_equal(again.positions, sites.positions)
        more = np.full((1, 3), 5e6), np.zeros(1, np.int32), None, np.ones((1, 1), np.float32)
        for s in (sites, again):
            s.add(Observations(*more))
        assert voxels(again) == voxels(sites)

    def test_nothing_round_trips(self) -> None:
        again = Sites(3, 1, 0.1)
        again.restore(Sites(3, 1, 0.1).to_arrays())
        assert len(again) == 0
        assert again.positions.shape == (0, 3)

    @pytest.mark.parametrize(
        "damage",
        ["twice", "negative", "no mass", "mass of one class only", "left its voxel", "below its voxel", "origin"],
    )
    def test_damage_is_refused(self, damage: str) -> None:
        arrays: dict[str, NDArray[Any]] = {name: a.copy() for name, a in self.sites().to_arrays().items()}
        if damage == "twice":
            arrays["voxels"][3] = arrays["voxels"][7]
        elif damage == "negative":
            arrays["voxels"][3] = -1
        elif damage == "mass of one class only":  # less mass than the position was summed over
            arrays["place"][3, :3] = arrays["mass"][3].sum() * PLACE_UNIT
            arrays["mass"][3, 1:] = 0
        elif damage == "left its voxel":
            arrays["place"][3, 1] = int(arrays["mass"][3].sum()) * PLACE_UNIT + 1
        elif damage == "below its voxel":
            arrays["place"][3, 2] = -1
        elif damage == "origin":
            arrays["origin"][1] += 1
        else:
            arrays["mass"][3] = 0
        with pytest.raises(InputError, match="damaged"):
            Sites(3, 1, 0.1).restore(arrays)

    def test_sites_on_the_rim_of_their_voxel_are_whole(self) -> None:
        arrays: dict[str, NDArray[Any]] = {name: a.copy() for name, a in self.sites().to_arrays().items()}
        arrays["place"][3, :3] = (0, 0, int(arrays["mass"][3].sum()) * PLACE_UNIT)
        again = Sites(3, 1, 0.1)
        again.restore(arrays)
        np.testing.assert_array_equal(again.place, arrays["place"])
