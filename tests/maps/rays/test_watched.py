"""Watched voxels: samples in them count, and which a ray has passed is told."""

import numpy as np
import pytest

from semgp.maps import rays
from semgp.maps.rays import free_samples
from semgp.voxels import VoxelTable, voxel_keys
from tests.maps.rays.walks import EDGE, NONE, around, sampled, walk


@pytest.mark.parametrize("shift", [0.0, 5e6])
@pytest.mark.parametrize("thin", [1, 8, NONE])
def test_watched_voxels(thin: int, shift: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples in them count wherever they are, and which of them a ray has passed is told."""
    monkeypatch.setattr(rays, "n_workers", lambda: 3)
    rng = np.random.default_rng(11)
    sensor = np.array([0.31, 0.17, 0.73]) + shift
    points = around(sensor, 300, 12)
    w = walk(thin=thin, origin=np.floor(sensor / EDGE), share=0.8, near=1.5 * EDGE)
    of_all = sampled(sensor, points, walk(origin=w.origin, share=0.8))[1]
    of_some = sampled(sensor, points, w)[1]

    table = VoxelTable()
    table.insert(rng.permutation(np.unique(of_all))[::2])
    somewhere = sensor + rng.uniform(-4, 4, (3000, 3))
    table.insert(voxel_keys(somewhere, EDGE, w.origin))
    watched = rng.random(len(table)) < 0.5
    samples, keys, passed = free_samples(sensor, points, w, table, watched)

    walked = set(of_all.tolist())
    naive_passed = [row for row, key in enumerate(table.keys.tolist()) if watched[row] and key in walked]
    assert 500 < len(naive_passed) < np.count_nonzero(watched) - 500
    assert np.flatnonzero(passed).tolist() == naive_passed
    in_watched = np.isin(keys, table.keys[watched])
    assert np.count_nonzero(in_watched) == np.isin(of_all, table.keys[watched]).sum()
    unwatched = of_some[~np.isin(of_some, table.keys[watched])]
    np.testing.assert_array_equal(keys[~in_watched], unwatched)
    np.testing.assert_array_equal(voxel_keys(samples, EDGE, w.origin), keys)


def test_nothing_watched_of_many() -> None:
    points = around(np.zeros(3), 300, 13)
    samples, keys = sampled(np.zeros(3), points, walk(thin=8))
    table = VoxelTable()
    table.insert(np.unique(keys))
    again, again_keys, passed = free_samples(
        np.zeros(3), points, walk(thin=8), table, np.zeros(len(table), dtype=bool)
    )
    assert not passed.any()
    np.testing.assert_array_equal(again, samples)
    np.testing.assert_array_equal(again_keys, keys)
