"""A page in a real browser."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

CHROMIUM = Path("/usr/bin/chromium")
SOFTWARE_GL = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


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


def until(tab: Any, done: Callable[[], bool]) -> None:
    """Wait for what the browser tells the server."""
    for _ in range(400):
        if done():
            return
        tab.wait_for_timeout(50)
    raise AssertionError("the server was not told")
