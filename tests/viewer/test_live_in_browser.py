"""The live viewer in a real browser."""

import pytest

from semgp.viewer.live import LiveViewer
from tests.viewer.browser import CHROMIUM, SOFTWARE_GL, until

pytest.importorskip("viser", reason="the live viewer needs the extra view")


@pytest.mark.skipif(not CHROMIUM.exists(), reason=f"{CHROMIUM} is not installed")
def test_a_browser_connects_and_asks(viewer: LiveViewer) -> None:
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    asked: list[str] = []
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=str(CHROMIUM), args=SOFTWARE_GL)
        tab = browser.new_page(viewport={"width": 1000, "height": 800})
        tab.on("request", lambda request: asked.append(request.url))
        tab.on("websocket", lambda socket: asked.append(socket.url))
        tab.goto(viewer.url)
        tab.get_by_label("floor", exact=True).wait_for(state="attached", timeout=60_000)
        tab.get_by_label("floor", exact=True).evaluate("box => box.click()")
        until(tab, lambda: 0 in viewer.state.hidden)
        assert viewer.wait(60)
        assert viewer.shown is not None
        before = viewer.shown
        assert not (before.sample.prediction.label[before.rows] == 0).any()
        field = tab.locator(f'input[type="text"][value="{viewer._controls.resolution.value:g}"]')
        field.evaluate("field => field.focus()")
        tab.keyboard.press("Control+A")
        tab.keyboard.type("30")
        tab.keyboard.press("Enter")
        until(tab, lambda: viewer.state.resolution == 0.3)
        assert viewer.wait(60)
        assert len(viewer.shown.sample.points) < len(before.sample.points)
        browser.close()
    here = (viewer.url, viewer.url.replace("http", "ws"), "blob:", "data:")
    assert asked
    assert [url for url in asked if not url.startswith(here)] == []
