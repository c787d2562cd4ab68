"""k-d trees of a cell's sites, against their definition; boxes, against volumes by brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.blocks.tree import overlapped, split
from tests.blocks.naive import Array, leaf_boxes, share

Tree = tuple[NDArray[np.int64], NDArray[np.int8], NDArray[np.float32], NDArray[np.int64]]


def tree(X: NDArray[np.float32], n_leaves: int) -> Tree:
    order, bounds = np.full(len(X), -1, np.int64), np.full(n_leaves + 1, -1, np.int64)
    axes, cuts = np.full(n_leaves - 1, -1, np.int8), np.full(n_leaves - 1, np.nan, np.float32)
    split(X, order, n_leaves, axes, cuts, bounds)
    return order, axes, cuts, bounds


def shares(axes: NDArray[np.int8], cuts: NDArray[np.float32], n: int, low: Array, high: Array, most: int) -> Array:
    leaves, found = np.full(most, -1, np.int64), np.full(most, np.nan, np.float32)
    # trees of other cells lie before and after
    wide_axes = np.concatenate([np.full(3, 9, np.int8), axes, np.full(2, 9, np.int8)])
    wide_cuts = np.concatenate([np.full(3, np.nan, np.float32), cuts, np.full(2, np.nan, np.float32)])
    box = low.astype(np.float32), high.astype(np.float32)
    count = overlapped(wide_axes, wide_cuts, 3, n, *box, leaves, found)
    assert len(set(leaves[:count].tolist())) == count
    total = np.zeros(n)
    total[leaves[:count]] = found[:count]
    return total


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(1, 9), st.sampled_from(["free", "grid", "one"]))
@settings(deadline=None, max_examples=60)
def test_leaves_are_balanced_and_on_their_side(seed: int, n_leaves: int, leaf: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    n = n_leaves * leaf + int(rng.integers(0, n_leaves))
    X = rng.uniform(0, 3.2, (n, 4)).astype(np.float32)
    if kind == "grid":  # many ties
        X = np.floor(X * 2)
    if kind == "one":  # nothing but duplicates
        X[:] = X[0]
    order, axes, cuts, bounds = tree(X, n_leaves)
    assert sorted(order.tolist()) == list(range(n))
    assert (bounds[0], bounds[-1]) == (0, n)
    sizes = np.diff(bounds)
    assert sizes.min() >= n // n_leaves - 1
    assert sizes.min() >= 1
    assert sizes.max() <= -(-n // n_leaves)
    assert ((axes >= 0) & (axes < 3)).all()
    for k, (low, high) in enumerate(leaf_boxes(axes, cuts, n_leaves, np.full(3, -np.inf), np.full(3, np.inf))):
        sites = X[order[bounds[k] : bounds[k + 1]], :3]
        assert (sites >= low).all()
        assert (sites <= high).all()


def test_planes_cut_the_widest_axis_between_two_sites() -> None:
    X = np.array([[0, 0, 5], [1, 9, 5], [0, 2, 6], [1, 4, 5]], dtype=np.float32)
    order, axes, cuts, bounds = tree(X, 2)
    assert (axes.tolist(), cuts.tolist(), bounds.tolist()) == ([1], [3.0], [0, 2, 4])
    assert (set(order[:2].tolist()), set(order[2:].tolist())) == ({0, 2}, {1, 3})


@given(st.integers(0, 2**32 - 1), st.integers(1, 33), st.floats(0.001, 2))
@settings(deadline=None, max_examples=60)
def test_shares_are_volumes(seed: int, n_leaves: int, edge: float) -> None:
    rng = np.random.default_rng(seed)
    _, axes, cuts, _ = tree(rng.uniform(0, 3.2, (3 * n_leaves, 3)).astype(np.float32), n_leaves)
    low = rng.uniform(0, 3.2 - edge, 3)
    high = low + edge * rng.uniform(0.5, 1, 3)
    found = shares(axes, cuts, n_leaves, low, high, 64)
    boxes = leaf_boxes(axes, cuts, n_leaves, np.full(3, -np.inf), np.full(3, np.inf))
    np.testing.assert_allclose(found, [share(a, b, low, high) for a, b in boxes], atol=2e-3 * 0.001 / edge + 1e-5)
    assert found.sum() == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("most", [1, 2, 5])
def test_shares_add_up_where_there_is_no_room_for_all(most: int) -> None:
    _, axes, cuts, _ = tree(np.random.default_rng(0).uniform(0, 1, (64, 3)).astype(np.float32), 16)
    found = shares(axes, cuts, 16, np.full(3, 0.1), np.full(3, 0.9), most)
    assert np.count_nonzero(found) <= most
    assert found.sum() == pytest.approx(1, abs=1e-6)


def test_a_point_lies_in_one_leaf_even_on_a_plane() -> None:
    rng = np.random.default_rng(1)
    _, axes, cuts, _ = tree(rng.uniform(0, 1, (64, 3)).astype(np.float32), 16)
    for axis, cut in zip(axes, cuts):
        point = rng.uniform(0, 1, 3)
        point[axis] = cut
        assert np.count_nonzero(shares(axes, cuts, 16, point, point, 64)) == 1
