"""Which points are kept."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgp.camera import Pinhole, cloud_from_depth
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.sampling import class_balanced, grid_stride, random_subset, without_labels

FOUR = Classes.numbered(4)


def cloud_of(labels: list[int]) -> LabelledCloud:
    return LabelledCloud(np.zeros((len(labels), 3)), FOUR, np.array(labels, dtype=int))


@given(st.integers(1, 7), st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32 - 1))
def test_grid_stride_against_a_loop(stride: int, height: int, width: int, seed: int) -> None:
    depth = np.random.default_rng(seed).choice([0.0, 1.0], (height, width))
    cloud = cloud_from_depth(depth, Pinhole(1, 1, 0, 0), FOUR)
    kept = {tuple(pixel) for pixel in np.asarray(cloud.pixels)[grid_stride(cloud, stride)].tolist()}
    assert kept == {(r, c) for r in range(0, height, stride) for c in range(0, width, stride) if depth[r, c] > 0}


def test_grid_stride_needs_pixels_and_a_stride() -> None:
    with pytest.raises(InputError, match="no pixels"):
        grid_stride(cloud_of([0]), 3)
    with pytest.raises(InputError, match="at least 1"):
        grid_stride(cloud_from_depth(np.ones((2, 2)), Pinhole(1, 1, 0, 0), FOUR), 0)


@given(st.integers(0, 50), st.integers(0, 60), st.integers(0, 2**32 - 1))
def test_random_subset(n_points: int, n: int, seed: int) -> None:
    cloud = cloud_of([0] * n_points)
    chosen = random_subset(cloud, n, seed)
    assert len(chosen) == min(n, n_points)
    assert (np.diff(chosen) > 0).all()
    np.testing.assert_array_equal(chosen, random_subset(cloud, n, seed))
    assert len(cloud[chosen]) == len(chosen)


def test_random_subset_depends_on_the_seed() -> None:
    cloud = cloud_of([0] * 1000)
    assert (random_subset(cloud, 10, 1) != random_subset(cloud, 10, 2)).any()


@given(st.lists(st.integers(-1, 3), max_size=80), st.integers(0, 90), st.integers(0, 2**32 - 1))
def test_class_balanced_is_as_equal_as_can_be(labels: list[int], n: int, seed: int) -> None:
    cloud = cloud_of(labels)
    chosen = class_balanced(cloud, n, seed)
    assert (np.diff(chosen) > 0).all()
    drawn = np.array(labels, dtype=int)[chosen]
    assert MISSING not in drawn
    available = {c: labels.count(c) for c in set(labels) - {MISSING}}
    assert len(chosen) == min(n, sum(available.values()))
    got = {c: int((drawn == c).sum()) for c in available}
    for c in available:
        for other in available:  # nobody could give one to a class that has fewer
            assert got[c] == available[c] or got[c] >= got[other] - 1
    np.testing.assert_array_equal(chosen, class_balanced(cloud, n, seed))


def test_class_balanced_hands_on_what_rare_classes_leave() -> None:
    labels = [0] * 100 + [1] * 2 + [2] * 50 + [MISSING] * 30
    drawn = np.array(labels)[class_balanced(cloud_of(labels), 42, seed=0)]
    assert [(drawn == c).sum() for c in range(3)] == [20, 2, 20]


def test_class_balanced_with_soft_labels() -> None:
    weights = np.array([[0.9, 0.1, 0, 0]] * 10 + [[0, 0, 0, 0.2]] * 3 + [[0, 0, 0, 0]] * 5)
    cloud = LabelledCloud(np.zeros((18, 3)), FOUR, weights=weights)
    chosen = class_balanced(cloud, 6, seed=0)
    assert (chosen < 10).sum() == 3
    assert ((chosen >= 10) & (chosen < 13)).sum() == 3


def test_negative_counts_are_refused() -> None:
    for choose in (random_subset, class_balanced):
        with pytest.raises(InputError, match="negative"):
            choose(cloud_of([0]), -1, 0)


def test_without_labels_keeps_the_points() -> None:
    keep = np.array([True, False, False])
    hard = cloud_of([2, 1, MISSING])
    np.testing.assert_array_equal(without_labels(hard, keep).labels, [2, MISSING, MISSING])
    np.testing.assert_array_equal(hard.labels, [2, 1, MISSING])
    soft = LabelledCloud(np.zeros((3, 3)), FOUR, weights=np.full((3, 4), 0.25))
    np.testing.assert_array_equal(without_labels(soft, keep).labelled, keep)
    bare = LabelledCloud(np.zeros((3, 3)), FOUR)
    assert without_labels(bare, keep).labels is None


@pytest.mark.parametrize("bad", [[True], [0, 1, 2], [[True, True, True]]])
def test_masks_that_are_refused(bad: list[object]) -> None:
    with pytest.raises(InputError, match="keep_mask"):
        without_labels(cloud_of([0, 1, 2]), np.array(bad))
