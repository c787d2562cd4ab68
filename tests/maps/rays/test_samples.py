"""Samples along rays, against a walk along each of them in plain Python."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.maps import rays
from semgp.voxels import voxel_keys
from tests.maps.rays.walks import EDGE, NONE, around, naive_walk, off_faces, phases, sampled, walk, world


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.0, -3.0, 5e6]),
    st.sampled_from([0.05, 0.2, 1 / 3]),
    st.sampled_from([0.3, 1.0, 2.5]),
    st.sampled_from([np.inf, 2.0, 0.4]),
    st.sampled_from([1, NONE]),
)
@settings(deadline=None, max_examples=40)
def test_a_ray_is_sampled_once_a_voxel(
    seed: int, shift: float, resolution: float, margin: float, reach: float, thin: int
) -> None:
    rng = np.random.default_rng(seed)
    sensor = rng.uniform(-1, 1, 3) + shift * np.array([1.0, -1.0, 0.5])
    points = around(sensor, 40, seed)
    w = walk(
        resolution=resolution, origin=np.floor(sensor / resolution) + rng.integers(-900, 900, 3), seed=seed,
        margin=margin * resolution, near=3.3 * resolution, thin=thin, reach=reach,
    )  # fmt: skip
    expected, near = naive_walk(sensor, points, w)
    expected = expected if thin == 1 else expected[near]
    samples, keys = sampled(sensor, points, w)
    np.testing.assert_allclose(samples, expected, rtol=0, atol=1e-7)
    inner = off_faces(samples, resolution)
    np.testing.assert_array_equal(world(keys, w)[inner], np.floor(samples / resolution)[inner])


def test_where_samples_may_lie() -> None:
    """Said once more without a phase: never beyond the margin or the reach, the first less than a step before."""
    sensor = np.array([0.3, -0.2, 0.7])
    points = np.concatenate([around(sensor, 300, 1), around(sensor, 100, 2, 0.0, 3 * EDGE), sensor[None]])
    for reach in (np.inf, 2.5):
        w = walk(margin=1.7 * EDGE, reach=reach)
        for point in points:
            samples, _ = sampled(sensor, point[None], w)
            t, length = np.linalg.norm(samples - sensor, axis=1), math.dist(sensor, point)
            last = min(length - 1.7 * EDGE, reach)
            if last >= 2 * EDGE:
                assert last - EDGE < t[0] <= last + 1e-12
                assert EDGE <= t[-1] < 2 * EDGE
                np.testing.assert_allclose(np.diff(t), -EDGE)
            else:
                assert len(t) <= 1
                assert (t <= last).all()


def test_phases_are_spread_over_a_voxel() -> None:
    drawn = phases(np.zeros(3), around(np.zeros(3), 8000, 3), seed=0)
    assert ((drawn > -1e-9) & (drawn < 1 + 1e-9)).all()
    counts = np.histogram(drawn, 10, (0, 1))[0]
    assert (np.abs(counts - 800) < 5 * math.sqrt(8000 * 0.1 * 0.9)).all()


@pytest.mark.parametrize("workers", [1, 3, 7, 5000])
def test_any_number_of_threads(workers: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """More samples than fit the first buffers, too: they grow."""
    points = around(np.zeros(3), 2000, 10, 3.0)
    parts = [sampled(np.zeros(3), part, walk()) for part in np.array_split(points, 50)]
    assert sum(len(keys) for _, keys in parts) > 1 << 16
    monkeypatch.setattr(rays, "n_workers", lambda: workers)
    samples, keys = sampled(np.zeros(3), points, walk())
    np.testing.assert_array_equal(samples, np.concatenate([s for s, _ in parts]))
    np.testing.assert_array_equal(keys, np.concatenate([k for _, k in parts]))


@pytest.mark.parametrize(("height", "edge"), [(0.3, 0.1), (1.2, 0.2), (0.15, 0.05)])
def test_a_level_lidar_on_a_face_between_voxels(height: float, edge: float) -> None:
    """All its samples, and all its points, lie where rounding decides: it must decide alike."""
    a = np.linspace(0, 6, 50)
    points = np.column_stack([4 * np.cos(a), 4 * np.sin(a), np.full(50, height)])
    points[::2, 2] = np.nextafter(height, 0)  # a hair off level
    for origin in (np.zeros(3), np.array([-640.0, 128.0, 64.0])):
        w = walk(resolution=edge, origin=origin)
        samples, keys = sampled(np.array([0.013, 0.027, height]), points, w)
        inner = off_faces(samples + np.array([0, 0, edge / 2]), edge)
        np.testing.assert_array_equal(keys[inner], voxel_keys(samples, edge, w.origin)[inner])


def test_rounding_does_not_depend_on_the_origin() -> None:
    sensor = np.array([0.5, 0.5, 5 - 3 * 2.0**-35])
    point = sensor + np.array([[20.0, 0, 0]])
    here, there = (walk(resolution=1.0, origin=np.array([0, 0, z])) for z in (0.0, 64.0))
    a, b = (world(sampled(sensor, point, w)[1], w) for w in (here, there))
    np.testing.assert_array_equal(a, b)
