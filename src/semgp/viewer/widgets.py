"""What the panel's controls have in common: what they act on, when, and how they look."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from semgp.viewer.state import ViewState

if TYPE_CHECKING:
    import viser


class Viewer(Protocol):
    """What the controls act on."""

    state: ViewState

    def change(self, **choices: Any) -> None:
        """Make choices of the state anew."""
        ...

    def switch(self, label: int, on: bool) -> None:
        """Switch a class on or off."""
        ...


def furnish(gui: viser.GuiApi, title: str) -> None:
    """Make room for the panel beside the picture, and give it a heading."""
    dress(gui, dark=False)
    gui.set_panel_label(title)
    gui.main_panel.dock_right()


def dress(gui: viser.GuiApi, *, dark: bool) -> None:
    """Give the page its looks, without the button that shares it beyond this machine."""
    gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=dark, brand_color=(35, 104, 196))


def when(handle: Any, act: Callable[[], None]) -> None:
    """Act when a control changes: in the server's loop, so that changes keep their order."""
    handle.on_update(in_loop(act))


def put(handle: Any, value: object) -> None:
    """Give a control a value: viser's types call it read-only."""
    handle.value = value


def in_loop(act: Callable[[], None]) -> Callable[[Any], Any]:
    """Return an act as a callback that runs in the server's loop."""

    async def callback(_: Any) -> None:
        act()

    return callback


def round_step(size: float) -> float:
    """Return 1, 2 or 5 times a power of ten, at most a size."""
    power = 10.0 ** np.floor(np.log10(size))
    return float(f"{max(m * power for m in (1, 2, 5) if m * power <= size * (1 + 1e-9)):.12g}")
