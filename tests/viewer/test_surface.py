"""Points on the mapped surface, and its normals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.errors import InputError
from semgp.viewer.surface import Surface


@pytest.mark.parametrize("shift", [0.0, 5e6])
def test_coarse_points_are_means_of_voxels(plane: np.ndarray, shift: float) -> None:
    points, resolution = Surface(plane + shift).points(0.4, 1000)
    assert resolution == 0.4
    near = {tuple(v) for v in np.floor((plane + 1e-9) / 0.4).astype(int)} if shift == 0 else None
    assert near is None or len(points) == len(near)
    np.testing.assert_allclose(points[:, 2] - shift, 0, atol=1e-8)
    np.testing.assert_allclose(points.mean(axis=0) - shift, [1, 1, 0], atol=0.11)


def test_fine_points_fill_the_plane_between_the_data(plane: np.ndarray) -> None:
    points, resolution = Surface(plane).points(0.025, 100_000)
    assert resolution == 0.025
    assert len(points) > 10 * len(plane)
    np.testing.assert_allclose(points[:, 2], 0, atol=1e-9)
    gaps = np.abs(points[:, None, :2] - plane[::7, :2] - (0.05, 0.05)).max(axis=2).min(axis=0)
    assert gaps.max() < 0.05


@settings(deadline=None, max_examples=40)
@given(st.floats(1e-3, 2.0), st.integers(1, 3000))
def test_never_more_points_than_there_is_room_for(resolution: float, most: int) -> None:
    rng = np.random.default_rng(0)
    points, kept = Surface(rng.uniform(0, 2, (300, 3))).points(resolution, most)
    assert 0 < len(points) <= most
    assert kept >= resolution


def test_normals_point_to_free_space(plane: np.ndarray) -> None:
    above = np.add(plane, (0, 0, 0.3))
    normals, one_sided = Surface(plane, above).sides(plane)
    np.testing.assert_allclose(normals, np.tile([0, 0, 1.0], (400, 1)), atol=1e-9)
    assert one_sided.all()
    np.testing.assert_allclose(Surface(plane, -above).sides(plane)[0][:, 2], -1, atol=1e-9)
    line = np.column_stack([np.arange(50) / 10, np.zeros(50), np.zeros(50)])
    for _none, sided in (Surface(line).sides(line), Surface(plane).sides(plane)):
        assert not sided.any()
    assert not Surface(line).sides(line)[0].any()


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_handful_of_data(n: int) -> None:
    data = np.eye(3)[:n]
    points, _ = Surface(data).points(0.2, 1000)
    assert np.isfinite(points).all()
    assert np.isfinite(Surface(np.zeros((n, 3))).points(0.5, 10)[0]).all()


def test_a_surface_needs_data_and_a_resolution(plane: np.ndarray) -> None:
    with pytest.raises(InputError, match="map is empty"):
        Surface(np.empty((0, 3)))
    with pytest.raises(InputError, match="positive number of metres"):
        Surface(plane).points(0, 10)
    with pytest.raises(InputError, match="at least one point"):
        Surface(plane).points(1, 0)
