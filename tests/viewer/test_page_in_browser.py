"""What a browser makes of the self-contained page."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.viewer import write_page
from tests.viewer.browser import CHROMIUM, SOFTWARE_GL, Opened, changed
from tests.viewer.maps import built
from tests.viewer.test_page import HOSTILE


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if not CHROMIUM.exists():
        pytest.skip(f"{CHROMIUM} is not installed")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as p:
        yield p.chromium.launch(executable_path=str(CHROMIUM), args=SOFTWARE_GL)


def test_a_browser_shows_it(browser: Any, corner: LabelledCloud, tmp_path: Path) -> None:
    write_page(built(corner), tmp_path / "map.html", title="Corner", resolution=0.05)
    opened = Opened(browser, tmp_path / "map.html")
    tab, first = opened.tab, opened.picture()
    palette = corner.classes.palette.astype(int)
    for colour in palette[:2]:  # lit and shaded: the hue is the class's
        share = (first[:, 310:] * colour).sum(axis=2) / (
            np.linalg.norm(first[:, 310:], axis=2) * np.linalg.norm(colour) + 1
        )
        assert np.count_nonzero(share > 0.995) > 2000
    without = opened.act(lambda: tab.get_by_role("checkbox", name="floor").uncheck())
    assert changed(first, without) > 2000
    again = opened.act(lambda: tab.get_by_role("checkbox", name="floor").check())
    assert changed(first, again) < 50
    assert changed(again, opened.act(lambda: tab.select_option("#field", "entropy"))) > 2000
    assert tab.is_visible("#bar")
    opened.act(lambda: tab.select_option("#field", "class"))
    cut = opened.act(lambda: tab.locator("#to").evaluate("e => { e.value = 0.5; e.oninput(); }"))
    assert changed(first, cut) > 500
    assert changed(first, opened.act(lambda: tab.click("#uncut"))) < 50
    assert changed(first, opened.act(lambda: tab.locator("#levels button").nth(2).click())) > 500
    assert changed(first, opened.act(lambda: tab.click("#theme"))) > 20_000
    assert opened.requests == [(tmp_path / "map.html").as_uri()]
    opened.close()


def test_a_click_reads_a_point(browser: Any, corner: LabelledCloud, tmp_path: Path) -> None:
    gp_map = built(corner, shift=5e6)
    write_page(gp_map, tmp_path / "map.html", resolution=0.05)
    opened = Opened(browser, tmp_path / "map.html")
    tab, picture = opened.tab, opened.picture()
    ground = picture[-60, 320]
    rows, cols = np.nonzero(np.abs(picture - ground).max(axis=2)[80:600, 330:] > 30)
    middle = np.argmin((rows - rows.mean()) ** 2 + (cols - cols.mean()) ** 2)
    opened.act(lambda: tab.mouse.click(330 + int(cols[middle]), 80 + int(rows[middle])))
    place = np.array([[float(v) for v in re.findall(r"[xyz] (\S+)", tab.inner_text("#answer-place"))]])
    prediction = gp_map.query(place)
    told = [
        (name, float(p) / 100) for name, p in re.findall(r"(\w+)\s+([\d.]+) %", tab.inner_text("#answer-rows"))
    ]
    assert len(told) == 3
    assert [p for _, p in told] == sorted((p for _, p in told), reverse=True)
    for name, p in told:
        assert p == pytest.approx(prediction.probability[0, corner.classes.index(name)], abs=0.06)
    assert "variance" in tab.inner_text("#answer-facts")
    opened.act(lambda: tab.click("#close"))
    assert not tab.is_visible("#answer")
    opened.close()


def test_mouse_wheel_and_keys_move_the_view(browser: Any, corner: LabelledCloud, tmp_path: Path) -> None:
    write_page(built(corner), tmp_path / "map.html", resolution=0.1)
    opened = Opened(browser, tmp_path / "map.html")
    tab, first = opened.tab, opened.picture()

    def drag() -> None:
        tab.mouse.move(600, 300)
        tab.mouse.down()
        tab.mouse.move(700, 330, steps=3)
        tab.mouse.up()

    assert changed(first, opened.act(drag)) > 1000
    assert not tab.is_visible("#answer")
    assert changed(first, opened.act(lambda: tab.click("#home"))) < 50
    tab.mouse.move(600, 300)
    assert changed(first, opened.act(lambda: tab.mouse.wheel(0, 400))) > 1000
    opened.act(lambda: tab.click("#home"))
    assert changed(first, opened.act(lambda: tab.press("#view", "ArrowLeft"))) > 1000
    opened.close()


def test_hostile_names_in_a_browser(browser: Any, corner: LabelledCloud, tmp_path: Path) -> None:
    write_page(built(corner, HOSTILE), tmp_path / "map.html", title=HOSTILE[0], resolution=0.2)
    opened = Opened(browser, tmp_path / "map.html", size=(390, 700), scheme="dark")
    assert set(opened.tab.locator("#legend .name").all_inner_texts()) >= set(HOSTILE)
    assert opened.tab.inner_text("#title") == HOSTILE[0]
    assert opened.tab.get_attribute("html", "data-theme") == "dark"
    opened.close()


def test_the_legend_lists_what_occurs_most_points_first(
    browser: Any, corner: LabelledCloud, tmp_path: Path
) -> None:
    names = ("floor", "wall", "table", "lamp")
    write_page(built(corner, names), tmp_path / "map.html", resolution=0.05)
    opened = Opened(browser, tmp_path / "map.html")
    tab = opened.tab
    for level in (0, 2):
        tab.locator("#levels button").nth(level).click()
        rows = [row for row in tab.locator("#legend li").all() if row.is_visible()]
        shown = [(row.locator(".name").inner_text(), row.locator(".share").inner_text()) for row in rows]
        assert "lamp" not in dict(shown)
        shares = [float(share.rstrip(" %")) for name, share in shown if name != "not observed"]
        assert shares == sorted(shares, reverse=True)
        assert sum(float(share.rstrip(" %")) for _, share in shown) == pytest.approx(100, abs=2)
    opened.close()


def test_walls_are_left_out_from_behind(browser: Any, corner: LabelledCloud, tmp_path: Path) -> None:
    write_page(built(corner), tmp_path / "map.html", resolution=0.05)
    opened = Opened(browser, tmp_path / "map.html")
    tab = opened.tab
    without = opened.act(lambda: [tab.press("#view", "ArrowLeft") for _ in range(26)])
    walls = opened.act(lambda: tab.get_by_label("See inside").uncheck())
    assert changed(without, walls) > 2000
    assert changed(without, opened.act(lambda: tab.get_by_label("See inside").check())) < 50
    opened.close()
