"""Which blocks answer a point, against boxes cut up by brute force."""

from collections import defaultdict

import numpy as np
import pytest

from semgp.blocks.field import Field
from semgp.blocks.model import BlockModel
from semgp.blocks.sites import CELL
from semgp.voxels import HALF_RANGE
from tests.blocks.naive import Array, featureless, filled, leaf_boxes, share, street, voxel_index

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
    pairs = field.pairs(points, half)
    for i, point in enumerate(points):
        mine = pairs.point == i
        expected = blocks_by_brute_force(field, point, half)
        found: dict[int, float] = defaultdict(float)
        for block, weight in zip(pairs.block[mine], pairs.weight[mine]):
            found[int(block)] += float(weight)
        for block in found.keys() | expected.keys():
            assert found[block] == pytest.approx(expected[block], abs=1e-4)
        assert pairs.weight[mine].sum() == pytest.approx(1, abs=1e-5)
        assert sorted(pairs.rank[mine]) == list(range(np.count_nonzero(mine)))


def test_places_are_counted_from_the_corner_of_the_block_s_cell(field: Field) -> None:
    points = EDGE + np.random.default_rng(3).uniform(-0.05, 0.05, (50, 3)) * (1, 1, 0.1)
    pairs = field.pairs(points, 2.0)
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
    pairs = field.pairs(points, 0.5)
    weight = np.bincount(pairs.point, pairs.weight, minlength=len(points))
    np.testing.assert_allclose(weight, 1, atol=1e-5)
    one = field.pairs(points[19_000:19_001], 0.5)
    mine = pairs.point == 19_000
    assert pairs.block[mine].tolist() == one.block.tolist()


def test_points_beyond_the_keys_have_no_block(field: Field) -> None:
    reach = HALF_RANGE * RESOLUTION
    far = np.array([[reach, 0, 0], [0, -2 * reach, 0], [0, 0, 1e30], [reach - 65 * RESOLUTION, 2.0, 0]])
    pairs = field.pairs(far, 0.5)
    assert set(pairs.block.tolist()) == {-1}
    np.testing.assert_allclose(np.bincount(pairs.point, pairs.weight), 1, atol=1e-6)


def test_answers_do_not_jump(field: Field) -> None:
    """Along a line across many blocks: steps of a hundredth of a voxel, small changes."""
    line = np.linspace((1.5, 3.0, 1.6), (4.9, 3.3, 1.6), 7000)
    p = field.query(line, featureless(len(line))).probability[:, 0]
    assert np.abs(np.diff(p)).max() < 0.03
    assert np.ptp(p) > 0.5


def test_no_points_have_no_pairs(field: Field) -> None:
    assert all(len(column) == 0 for column in field.pairs(np.empty((0, 3)), 0.5))
    assert field.query(np.empty((0, 3)), featureless(0)).probability.shape == (0, 2)


def test_a_query_leaves_the_sites_as_they_were(field: Field) -> None:
    before = {name: a.copy() for name, a in field.sites.to_arrays().items()}
    field.query(np.random.default_rng(5).uniform(-9, 15, (200, 3)), featureless(200))
    for name, array in field.sites.to_arrays().items():
        np.testing.assert_array_equal(array, before[name])
