"""Cubes against ray casting."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from semgp.conventions import NYU13
from semgp.errors import InputError
from semgp.evaluation.cubes import draw_cubes
from semgp.picture import View, by_class

PURE = np.array([(250, 0, 0), (0, 250, 0), (0, 0, 250)], dtype=np.uint8)


def nearest_cubes(
    centres: NDArray[np.float64], edge: float, view: View, columns: NDArray[np.float64], rows: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return which cube the ray through each place of the picture meets first, -1 for none."""
    x, y = (columns - (view.width - 1) / 2) / view.focal, (rows - (view.height - 1) / 2) / view.focal
    T = view.T_world_camera
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ T[:3, :3].T
    offset = (centres - T[:3, 3])[:, None, None]
    slabs = np.stack([(offset + side * edge / 2) / rays for side in (-1, 1)])
    enter, leave = slabs.min(axis=0).max(axis=-1), slabs.max(axis=0).min(axis=-1)
    enter = np.where((enter < leave) & (enter > 0), enter, np.inf)
    return np.where(np.isfinite(enter).any(axis=0), enter.argmin(axis=0), -1)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_cubes_are_those_that_rays_meet(seed: int) -> None:
    rng = np.random.default_rng(seed)
    edge = float(rng.uniform(0.05, 0.5))
    cells = np.argwhere(rng.random((4, 4, 4)) < rng.uniform(0.1, 0.6))
    centres = np.asarray(edge * (np.append(cells, [(0, 0, 0)], axis=0) + rng.integers(-9, 9, 3) + 0.5))
    centres = np.unique(centres, axis=0)
    direction = rng.normal(size=3)
    eye = centres.mean(axis=0) + 9 * edge * direction / np.linalg.norm(direction)
    view = View.look_at(eye, centres.mean(axis=0), fov=40, width=48, height=36)
    kind = rng.integers(0, 3, len(centres))

    drawn = draw_cubes(centres, edge, PURE[kind], view)
    seen = np.where((drawn == 255).all(axis=2), -1, drawn.argmax(axis=2))
    finely = np.meshgrid(np.arange(4 * 48) / 4, np.arange(4 * 36) / 4)
    met = nearest_cubes(centres, edge, view, *finely)
    met = np.where(met < 0, -1, kind[met])
    # away from borders, which pixels share
    inside = (maximum_filter(met, 13) == minimum_filter(met, 13))[::4, ::4]
    # one cube may show through a gap narrower than the quarter of a pixel that is looked at
    assert np.count_nonzero(seen[inside] != met[::4, ::4][inside]) <= 2
    assert inside.sum() > 300


def test_sides_differ_in_light_and_hidden_ones_are_not_drawn() -> None:
    view = View.look_at((3, -4, 3), (0, 0, 0), fov=30, width=48, height=36)
    one = draw_cubes([(0.0, 0, 0)], 1.0, PURE[:1], view)
    shades = {int(v) for v in np.unique(one[..., 0]) if (one[..., 0] == v).sum() > 20 and v < 255}
    assert len(shades) == 3
    assert np.array_equal(draw_cubes([(0.0, 0, 0)], 1.0, PURE[:1], view), one)


def test_cubes_behind_or_around_the_eye_are_left_out() -> None:
    view = View.look_at((0, 0, 0), (1, 0, 0), width=48, height=36)
    assert (draw_cubes([(-3.0, 0, 0), (0, 0, 0)], 1.0, PURE[:2], view) == 255).all()
    assert (draw_cubes(np.zeros((0, 3)), 1.0, PURE[:0], view, (1, 2, 3)) == (1, 2, 3)).all()


@pytest.mark.parametrize(
    ("centres", "edge", "colours", "message"),
    [
        (np.full((2, 3), np.nan), 1.0, PURE[:2], "finite"),
        (np.zeros((2, 2)), 1.0, PURE[:2], "shape"),
        (np.zeros((2, 3)), 0.0, PURE[:2], "positive"),
        (np.zeros((2, 3)), float("nan"), PURE[:2], "positive"),
        (np.zeros((2, 3)), 1.0, PURE, "colours"),
        (np.zeros((2, 3)), 1.0, PURE[:2] / 255, "colours"),
    ],
)
def test_what_cubes_refuse(
    centres: NDArray[np.float64], edge: float, colours: NDArray[np.uint8], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        draw_cubes(centres, edge, colours, View(np.eye(4), width=48, height=36))


def test_class_colours_reach_the_picture() -> None:
    view = View.look_at((0, -4, 0), (0, 0, 0), fov=30, width=48, height=36)
    drawn = draw_cubes([(0.0, 0, 0)], 1.0, by_class(np.array([4]), NYU13), view)
    middle = drawn[18, 24].astype(float)
    assert np.allclose(middle / middle.max(), np.array(NYU13.colours[4]) / max(NYU13.colours[4]), atol=0.02)
