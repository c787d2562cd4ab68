"""The self-contained page: what is in it, and what a browser makes of it."""

import base64
import io
import json
import re
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.viewer import page, write_page

CHROMIUM = Path("/usr/bin/chromium")
SOFTWARE_GL = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
HOSTILE = (
    "</script><script>alert(1)</script>",
    "<!--<img src=x onerror=alert(2)>",
    '{{data}} & "it\'s" ]]>\u2028',
)
MODEL = replace(GENERAL, resolution=0.1)


def built(cloud: LabelledCloud, names: tuple[str, ...] | None = None, shift: float = 0.0) -> GPSemanticMap:
    classes = cloud.classes if names is None else Classes(names)
    T = np.eye(4)
    T[:3, 3] = np.array([1.0, -1.0, 1.2]) + shift
    made = GPSemanticMap(classes, MODEL, free=FreeSpace())
    made.update(LabelledCloud(cloud.points + shift, classes, cloud.labels, T_world_sensor=T))
    return made


def embedded(text: str) -> dict[str, Any]:
    match = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert match is not None
    data: dict[str, Any] = json.loads(match[1])
    return data


def columns(level: dict[str, Any]) -> dict[str, np.ndarray]:
    raw = zlib.decompress(base64.b64decode(level["data"]))
    return {
        name: np.frombuffer(raw, "<" + c["type"], level["points"] * c["width"], c["offset"]).reshape(
            level["points"], c["width"]
        )
        for name, c in level["columns"].items()
    }


@pytest.mark.parametrize("shift", [0.0, 5e6])
def test_what_is_embedded_is_what_the_map_says(corner: LabelledCloud, shift: float) -> None:
    gp_map = built(corner, shift=shift)
    data = embedded(page(gp_map, resolution=0.1))
    assert [level["resolution"] for level in data["levels"]] == pytest.approx([0.1, 0.2, 0.4])
    assert data["oriented"]
    for level in data["levels"]:
        column = columns(level)
        points = np.array(level["low"]) + column["position"] / 65535 * np.array(level["extent"])
        prediction = gp_map.query(points)
        best = np.take_along_axis(prediction.probability, column["top"].astype(int), axis=1)
        np.testing.assert_allclose(column["p"] / 255, best, atol=0.006)
        np.testing.assert_array_equal(column["label"] == 3, (prediction.label == -1)[:, None])
        np.testing.assert_array_equal(np.diff(column["p"].astype(int), axis=1) <= 0, True)
        low, high = level["scales"]["variance"]
        assert prediction.variance is not None
        np.testing.assert_allclose(
            low + column["variance"][:, 0] / 255 * (high - low),
            np.where(prediction.observed, prediction.variance[:, 0], low),
            atol=0.01,
        )


def test_the_page_is_self_contained(corner: LabelledCloud) -> None:
    text = page(built(corner), title="A <room> & more")
    assert "<title>A &lt;room&gt; &amp; more</title>" in text
    assert not re.search(r"https?://|src=|@import|url\(", text)
    assert "default-src 'none'" in text


def test_hostile_names_stay_names(corner: LabelledCloud) -> None:
    text = page(built(corner, HOSTILE), title=HOSTILE[0])
    assert text.count("<script") == text.count("</script>") == 2
    assert "<img" not in text
    assert [c["name"] for c in embedded(text)["classes"]] == list(HOSTILE)


def test_the_size_is_bounded(corner: LabelledCloud, tmp_path: Path) -> None:
    gp_map = built(corner)
    size = write_page(gp_map, tmp_path / "map.html", most_bytes=140_000)
    assert size == (tmp_path / "map.html").stat().st_size <= 140_000
    with pytest.raises(InputError, match="does not fit its size"):
        page(gp_map, most_bytes=140_000, resolution=0.005)
    with pytest.raises(InputError, match="no room for points"):
        page(gp_map, most_bytes=1000)


def test_many_classes(corner: LabelledCloud) -> None:
    data = embedded(page(built(corner, tuple(f"c{i}" for i in range(300))), resolution=0.2))
    assert columns(data["levels"][0])["label"].max() in (2, 300)


def test_bad_input(corner: LabelledCloud, tmp_path: Path) -> None:
    gp_map = built(corner)
    with pytest.raises(InputError, match="map is empty"):
        page(GPSemanticMap(corner.classes, MODEL))
    with pytest.raises(InputError, match="no class is called 'sofa'"):
        page(gp_map, hide=["sofa"])
    with pytest.raises(InputError, match="no field 'depth'"):
        page(gp_map, field="depth")
    with pytest.raises(InputError, match="up is one of"):
        page(gp_map, up="w")
    with pytest.raises(InputError, match=r"ends in \.html"):
        write_page(gp_map, tmp_path / "map.txt")
    with pytest.raises(InputError, match="positive number of metres"):
        page(gp_map, resolution=float("nan"))
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if not CHROMIUM.exists():
        pytest.skip(f"{CHROMIUM} is not installed")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as p:
        yield p.chromium.launch(executable_path=str(CHROMIUM), args=SOFTWARE_GL)


class Opened:
    """A page in a browser, and what it asked for."""

    def __init__(
        self, browser: Any, path: Path, size: tuple[int, int] = (1000, 700), scheme: str = "light"
    ) -> None:
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.tab = browser.new_page(viewport=dict(zip(("width", "height"), size)), color_scheme=scheme)
        self.tab.on("request", lambda request: self.requests.append(request.url))
        self.tab.on("pageerror", lambda error: self.errors.append(str(error)))
        self.tab.on("dialog", lambda dialog: self.errors.append(dialog.message))
        self.tab.goto(path.as_uri())
        self.settle(0)

    @property
    def drawn(self) -> int:
        return int(self.tab.get_attribute("#view", "data-drawn") or 0)

    def settle(self, before: int) -> None:
        for _ in range(600):
            if self.drawn > before and self.tab.get_attribute("#view", "data-busy") is None:
                return
            self.tab.wait_for_timeout(50)
        raise AssertionError(f"nothing was drawn: {self.tab.inner_text('#message')}")

    def act(self, action: Any) -> np.ndarray:
        before = self.drawn
        action()
        self.settle(before)
        return self.picture()

    def picture(self) -> np.ndarray:
        return np.asarray(Image.open(io.BytesIO(self.tab.screenshot())).convert("RGB")).astype(int)

    def close(self) -> None:
        self.tab.close()
        assert not self.errors


def changed(a: np.ndarray, b: np.ndarray) -> int:
    """Pixels that differ, right of the panel and above the buttons."""
    return int(np.count_nonzero(np.abs(a - b)[:-60, 310:].max(axis=2) > 20))


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
    assert opened.tab.locator("#legend .name").all_inner_texts()[0] == HOSTILE[0]
    assert opened.tab.inner_text("#title") == HOSTILE[0]
    assert opened.tab.get_attribute("html", "data-theme") == "dark"
    opened.close()
