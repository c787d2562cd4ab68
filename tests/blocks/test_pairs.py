"""Which blocks answer a point, against boxes cut up by brute force."""

from collections import defaultdict

import numpy as np
import pytest

from semgp.blocks.cells import CELL
from semgp.blocks.field import Field
from semgp.blocks.model import BlockModel
from semgp.blocks.observations import Observations
from semgp.blocks.pairs import find_pairs
from semgp.voxels import HALF_RANGE
from tests.blocks.naive import (
    Array,
    featureless,
    filled,
    leaf_boxes,
    pairs_of,
    piece_of,
    share,
    street,
    voxel_index,
)

MODEL = BlockModel(posterior="vote", leaf=9, near=2, far=2)
RESOLUTION = MODEL.resolution
EDGE = CELL * RESOLUTION


@pytest.fixture(scope="module")
def field() -> Field:
    return filled(MODEL, *street(0, 900, 2), 2)


def blocks_by_brute_force(field: Field, point: Array, half: float) -> dict[int, float]:
    """Weight of each block; what no block answers, or none that is solved, goes to -1."""
    assert field.sites.origin is not None
    low, high = point - half * RESOLUTION, point + half * RESOLUTION
    trees = field.store.trees(field.sites.cells)
    found: dict[int, float] = defaultdict(float)
    for cell, index in enumerate(voxel_index(field.sites.cells.keys)):
        corner = (index + field.sites.origin) * RESOLUTION
        if trees.block[cell] < 0 or not share(corner, corner + EDGE, low, high):
            continue
        a, n = trees.tree_at[cell], int(trees.leaves[cell])
        tree = trees.axes[a : a + n - 1], trees.cuts[a : a + n - 1]
        for k, (b, c) in enumerate(leaf_boxes(*tree, n, np.zeros(3), np.full(3, EDGE))):
            found[int(trees.block[cell]) + k] += share(corner + b, corner + c, low, high)
    found[-1] = 1 - sum(found.values())
    return found


@pytest.mark.parametrize("half", [0.5, 1.7, 4.0])
def test_blocks_and_weights(field: Field, half: float) -> None:
    rng = np.random.default_rng(int(10 * half))
    points = np.concatenate([
        rng.uniform((1, 1, 1.4), (5.5, 5.5, 1.8), (60, 3)),
        EDGE + rng.uniform(-0.1, 0.1, (40, 3)) * (1, 1, 5),  # round the corner of cells
        rng.uniform(-20, 20, (20, 3)),
    ])  # fmt: skip
    pairs = pairs_of(field, points, half)
    for i, point in enumerate(points):
        mine = pairs.point == i
        expected = blocks_by_brute_force(field, point, half)
        found: dict[int, float] = defaultdict(float)
        for block, weight in zip(pairs.block[mine], pairs.weight[mine]):
            found[int(block)] += float(weight)
        for block in found.keys() | expected.keys():
            assert found[block] == pytest.approx(expected[block], abs=1e-4)
        assert pairs.weight[mine].sum() == pytest.approx(1, abs=1e-5)
        known = pairs.block[mine & (pairs.block >= 0)]
        assert len(set(known.tolist())) == len(known)  # no block twice
    assert (np.diff(pairs.point) >= 0).all()


@pytest.mark.parametrize("half", [0.5, 6.0])
def test_pairs_of_chosen_points_are_theirs_among_all(field: Field, half: float) -> None:
    """In the order of choice, however many pairs there are for each."""
    rng = np.random.default_rng(7)
    points = rng.uniform((1, 1, 1.4), (5.5, 5.5, 1.8), (700, 3))
    every = pairs_of(field, points, half)
    assert field.sites.origin is not None
    chosen = rng.permutation(700)[:300]
    some = find_pairs(
        points,
        chosen,
        RESOLUTION,
        field.sites.origin.astype(np.float64),
        half,
        field.store.trees(field.sites.cells),
    )
    rows = np.concatenate([np.flatnonzero(every.point == i) for i in chosen])
    for name in every._fields:
        np.testing.assert_array_equal(getattr(some, name), getattr(every, name)[rows])


def test_places_are_counted_from_the_corner_of_the_block_s_cell(field: Field) -> None:
    points = EDGE + np.random.default_rng(3).uniform(-0.05, 0.05, (50, 3)) * (1, 1, 0.1)
    pairs = pairs_of(field, points, 2.0)
    assert len(pairs.point) > 100
    trees = field.store.trees(field.sites.cells)
    assert field.sites.origin is not None
    corners = (voxel_index(field.sites.cells.keys) + field.sites.origin) * RESOLUTION
    for point, block, local in zip(points[pairs.point], pairs.block, pairs.local):
        inside = (trees.block >= 0) & (trees.block <= block) & (block < trees.block + trees.leaves)
        if block >= 0:
            np.testing.assert_allclose(local + corners[inside][0], point, atol=1e-5)


def test_points_are_counted_through_slices(field: Field) -> None:
    points = np.random.default_rng(4).uniform(1, 5, (20_000, 3))
    pairs = pairs_of(field, points, 0.5)
    weight = np.bincount(pairs.point, pairs.weight, minlength=len(points))
    np.testing.assert_allclose(weight, 1, atol=1e-5)
    one = pairs_of(field, points[19_000:19_001], 0.5)
    mine = pairs.point == 19_000
    assert pairs.block[mine].tolist() == one.block.tolist()
    all_homes, few = field.home(points), field.home(points[19_000:])
    np.testing.assert_array_equal(all_homes[0][19_000:], few[0])
    np.testing.assert_array_equal(all_homes[1][19_000:], few[1])


def test_answers_do_not_depend_on_who_is_asked_along(field: Field) -> None:
    """Queries run chunk by chunk, point by point of one block: each point gets what it gets alone."""
    points = np.random.default_rng(8).uniform((0, 0, 1), (6, 6, 2), (10_000, 3))
    found = field.query(points, featureless(10_000))
    for rows in (np.arange(9_000, 9_060), np.arange(10_000)[::-1], np.repeat(np.arange(0, 10_000, 500), 3)):
        again = field.query(points[rows], featureless(len(rows)))
        np.testing.assert_allclose(again.probability, found.probability[rows], atol=2e-6)
        np.testing.assert_allclose(again.variance, found.variance[rows], rtol=1e-5)
    np.testing.assert_allclose(found.probability.sum(axis=1), 1, atol=1e-5)


class TestHome:
    def test_is_where_a_tiny_box_lies(self, field: Field) -> None:
        rng = np.random.default_rng(9)
        points = np.concatenate([
            rng.uniform((1, 1, 1.4), (5.5, 5.5, 1.8), (600, 3)), EDGE + rng.uniform(-0.1, 0.1, (100, 3)),
            rng.uniform(-20, 20, (300, 3)),
        ])  # fmt: skip
        pairs = pairs_of(field, points, 1e-3)
        block, local = field.home(points)
        whole = np.flatnonzero(np.bincount(pairs.point) == 1)  # in one leaf with all of the box
        assert len(whole) > 900
        rows = np.searchsorted(pairs.point, whole)
        np.testing.assert_array_equal(block[whole], pairs.block[rows])
        np.testing.assert_array_equal(local[whole], pairs.local[rows])
        for i in np.setdiff1d(np.arange(1000), whole):
            assert block[i] in pairs.block[pairs.point == i]
        assert (block == -1).any()
        assert len(np.unique(block)) > 50

    def test_is_the_leaf_that_holds_the_point(self, field: Field) -> None:
        points = np.random.default_rng(10).uniform((1, 1, 1.4), (5.5, 5.5, 1.8), (150, 3))
        block, local = field.home(points, solve=True)
        trees = field.store.trees(field.sites.cells)
        assert field.sites.origin is not None
        assert (block >= 0).all()
        for point, b, x in zip(points, block, local):
            (cell,) = np.flatnonzero((trees.block <= b) & (b < trees.block + trees.leaves))
            corner = (voxel_index(field.sites.cells.keys[cell : cell + 1])[0] + field.sites.origin) * RESOLUTION
            np.testing.assert_allclose(x, point - corner, atol=1e-6)
            a, n = trees.tree_at[cell], int(trees.leaves[cell])
            boxes = leaf_boxes(
                trees.axes[a : a + n - 1], trees.cuts[a : a + n - 1], n, np.zeros(3), np.full(3, EDGE)
            )
            low, high = boxes[int(b - trees.block[cell])]
            np.testing.assert_array_less(low - 1e-6, x)
            np.testing.assert_array_less(x, high + 1e-6)

    def test_of_sites_is_the_block_that_has_them_as_its_own(self, field: Field) -> None:
        """A leaf's first members are its own sites: each of them is at home there."""
        field.solve()
        trees = field.store.trees(field.sites.cells)
        block, local = field.home(field.sites.positions)
        owned = np.bincount(block, minlength=field.store.n_blocks)
        sizes = np.array([trees.leaves[c] for c in field.sites._cell[: len(field.sites)]])
        assert (sizes > 0).all()
        for b in np.unique(block)[::7]:
            piece, place = piece_of(field, int(b))
            own = piece.solved.X[place, :, : owned[b]].T
            mine = local[block == b]
            np.testing.assert_allclose(own[np.lexsort(own.T)], mine[np.lexsort(mine.T)], atol=2e-5)
            assert owned[b] <= MODEL.leaf

    def test_solves_when_asked_to(self) -> None:
        points, labels = street(1, 300, 2)
        field = filled(MODEL, points, labels, 2)
        before = field.home(points)
        assert (before[0] == -1).all()
        assert field.store.next_block == 0
        block, local = field.home(points, solve=True)
        assert (block >= 0).all()
        np.testing.assert_array_equal(local, before[1])
        field.add(Observations(points[:1], labels[:1], None, featureless(1)))
        np.testing.assert_array_equal(field.home(points)[0], block)  # as they were solved
        solved = field.store.next_block
        field.home(points, solve=True)
        assert field.store.next_block > solved
        beside = np.array([[3.0, 3.0, 5.0]])  # a cell without sites beside some with
        assert field.home(beside)[0] == -1
        assert field.home(beside, solve=True)[0] >= 0

    def test_beyond_the_keys_there_is_none(self, field: Field) -> None:
        far = np.array([[HALF_RANGE * RESOLUTION, 0, 0], [0, 0, -1e30], [np.inf, 0, 0]])
        block, local = field.home(far, solve=True)
        assert block.tolist() == [-1, -1, -1]
        np.testing.assert_array_equal(local, 0)

    def test_of_no_points(self, field: Field) -> None:
        block, local = field.home(np.empty((0, 3)), solve=True)
        assert (block.shape, local.shape) == ((0,), (0, 3))


def test_points_beyond_the_keys_have_no_block(field: Field) -> None:
    reach = HALF_RANGE * RESOLUTION
    far = np.array([[reach, 0, 0], [0, -2 * reach, 0], [0, 0, 1e30], [reach - 65 * RESOLUTION, 2.0, 0]])
    pairs = pairs_of(field, far, 0.5)
    assert set(pairs.block.tolist()) == {-1}
    np.testing.assert_allclose(np.bincount(pairs.point, pairs.weight), 1, atol=1e-6)


def test_answers_do_not_jump(field: Field) -> None:
    """Along a line across many blocks: steps of a hundredth of a voxel, small changes."""
    line = np.linspace((1.5, 3.0, 1.6), (4.9, 3.3, 1.6), 7000)
    p = field.query(line, featureless(len(line))).probability[:, 0]
    assert np.abs(np.diff(p)).max() < 0.03
    assert np.ptp(p) > 0.5


def test_no_points_have_no_pairs(field: Field) -> None:
    assert all(len(column) == 0 for column in pairs_of(field, np.empty((0, 3)), 0.5))
    assert field.query(np.empty((0, 3)), featureless(0)).probability.shape == (0, 2)


def test_a_query_leaves_the_sites_as_they_were(field: Field) -> None:
    before = {name: a.copy() for name, a in field.sites.to_arrays().items()}
    field.query(np.random.default_rng(5).uniform(-9, 15, (200, 3)), featureless(200))
    for name, array in field.sites.to_arrays().items():
        np.testing.assert_array_equal(array, before[name])
