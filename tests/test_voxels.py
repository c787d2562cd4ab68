"""Keys of voxels and the table of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.errors import InputError
from semgp.voxels import HALF_RANGE, MARGIN, OUTSIDE, VoxelTable, voxel_centres, voxel_keys, voxel_origin


@given(
    st.integers(0, 2**32),
    st.sampled_from([0.01, 0.02, 0.1, 0.25, 1.0]),
    st.sampled_from([0.0, 5e6, -1e7]),
)
@settings(max_examples=40, deadline=None)
def test_keys_tell_voxels_apart_exactly(seed: int, resolution: float, away: float) -> None:
    points = np.random.default_rng(seed).normal(away, 5 * resolution, (200, 3))
    keys = voxel_keys(points, resolution, voxel_origin(points, resolution))
    voxel = np.floor(points / resolution)
    same_voxel = (voxel[:, None] == voxel[None]).all(axis=2)
    np.testing.assert_array_equal(keys[:, None] == keys[None], same_voxel)
    centres = voxel_centres(keys, resolution, voxel_origin(points, resolution))
    np.testing.assert_allclose(centres, (voxel + 0.5) * resolution, rtol=1e-15)


def test_keys_out_of_range_are_refused_or_marked() -> None:
    edge = float(HALF_RANGE - MARGIN)
    inside, outside = np.array([[0, edge - 1, -edge]]), np.array([[0, edge, 0]])
    assert voxel_keys(inside, 1.0)[0] > 0
    with pytest.raises(InputError, match="larger voxels"):
        voxel_keys(outside, 1.0)
    far = np.array([[1e300, 0, 0], [0, -float(HALF_RANGE) - 1, 0]])
    assert voxel_keys(far, 1.0, allow_outside=True).tolist() == [OUTSIDE, OUTSIDE]
    with pytest.raises(InputError, match="cannot be put"):
        voxel_origin(far, 1.0)


def test_the_table_agrees_with_a_dictionary() -> None:
    rng = np.random.default_rng(15)
    table = VoxelTable()
    rows: dict[int, int] = {}
    for _ in range(20):
        keys = rng.integers(0, 2**62, 50) // 2**40 * 2**40 // rng.integers(1, 4)
        for key in keys:
            rows.setdefault(int(key), len(rows))
        assert table.insert(keys).tolist() == [rows[int(key)] for key in keys]
    assert table.keys.tolist() == list(rows)
    strangers = np.array([OUTSIDE, 1, 2, 3])
    assert table.find(np.concatenate([table.keys, strangers])).tolist() == [*range(len(rows)), -1, -1, -1, -1]
