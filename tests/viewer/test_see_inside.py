"""Walls that turn their back to an eye are left out, so that one looks into a room."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.prediction import Prediction
from semgp.viewer.live import LiveViewer
from semgp.viewer.sample import Sample
from semgp.viewer.sight import backs, pick
from semgp.viewer.state import ViewState, show
from semgp.viewer.surface import Surface
from tests.viewer.browser import CHROMIUM, SOFTWARE_GL, until

SIZE = np.array([4.0, 3.0, 2.4])
EYE = np.array([-5.0, 1.45, 1.25])


def room() -> np.ndarray:
    """Floor, ceiling and four walls of a room, one datum every 10 cm, and a table top in its middle."""
    sides = []
    for axis in range(3):
        u, v = (np.arange(0.05, SIZE[other], 0.1) for other in range(3) if other != axis)
        plane = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        sides += [np.insert(plane, axis, at, axis=1) for at in (0.0, SIZE[axis])]
    top = np.stack(np.meshgrid(np.arange(1.5, 2.5, 0.1), np.arange(1, 2, 0.1), [0.8]), axis=-1).reshape(-1, 3)
    return np.concatenate([*sides, top])


def sampled(surface: Surface) -> Sample:
    points = surface.positions
    prediction = Prediction(Classes(("all",)), np.ones((len(points), 1)), np.ones(len(points), dtype=bool))
    return Sample(points, *surface.sides(points), prediction, 0.1)


def away_from_edges(points: np.ndarray) -> np.ndarray:
    return np.sort(np.minimum(points, SIZE - points), axis=1)[:, 1] > 0.3


@pytest.mark.parametrize("free", [False, True])
def test_the_near_wall_is_left_out_and_what_it_hid_stays(free: bool) -> None:
    air = np.stack(np.meshgrid(*[np.arange(0.2, s, 0.2) for s in SIZE]), axis=-1).reshape(-1, 3)
    sample = sampled(Surface(room(), air if free else None))
    turned = backs(show(sample, ViewState(0.1)), EYE)
    x, inner = sample.points[:, 0], away_from_edges(sample.points) & (sample.points[:, 2] != 0.8)
    np.testing.assert_array_equal(turned[inner & (x == 0)], True)
    np.testing.assert_array_equal(turned[inner & (x == SIZE[0])], False)
    assert not backs(show(sample, ViewState(0.1)), SIZE / 2)[inner].any()


def test_furniture_is_seen_from_all_sides() -> None:
    sample = sampled(Surface(room()))
    table = sample.points[:, 2] == 0.8
    assert not sample.one_sided[table].any()
    assert not backs(show(sample, ViewState(0.1)), (2, 1.5, -4))[table].any()


def test_a_ray_goes_through_a_back_to_what_is_seen() -> None:
    sample = sampled(Surface(room()))
    shown = show(sample, ViewState(0.1))
    at = {inside: pick(shown, EYE, (1, 0, 0), see_inside=inside) for inside in (False, True)}
    assert at[False] is not None
    assert at[True] is not None
    assert sample.points[at[False], 0] == 0
    assert sample.points[at[True], 0] == SIZE[0]


@pytest.mark.skipif(not CHROMIUM.exists(), reason=f"{CHROMIUM} is not installed")
def test_each_browser_is_sent_what_it_sees(viewer: LiveViewer) -> None:
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=str(CHROMIUM), args=SOFTWARE_GL)
        tab = browser.new_page(viewport={"width": 900, "height": 600})
        tab.goto(viewer.url)
        until(tab, drawn(viewer, lambda n, of: 0 < n <= of))
        (client,) = viewer._server.get_clients().values()
        middle = viewer._source.surface.positions.mean(axis=0) - viewer._scene._offset
        client.camera.position = middle + np.array([0, 8, -8])  # behind the wall and below the floor
        client.camera.look_at = middle
        until(tab, drawn(viewer, lambda n, of: n < 0.3 * of))
        tab.get_by_label("See inside", exact=True).evaluate("box => box.click()")
        until(tab, drawn(viewer, lambda n, of: n == of))
        assert not viewer.state.see_inside
        browser.close()


def drawn(viewer: LiveViewer, holds: Callable[[int, int], bool]) -> Callable[[], bool]:
    """Return whether something holds of how many points the one browser has, and of how many."""

    def check() -> bool:
        nodes: list[Any] = [
            client.scene.get_handle_by_name("/map") for client in viewer._server.get_clients().values()
        ]
        return (
            viewer.shown is not None
            and [n for n in nodes if n] != []
            and holds(len(nodes[0].points), len(viewer.shown.rows))
        )

    return check
