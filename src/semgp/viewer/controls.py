"""The live viewer's panel: what each control changes of the view's state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from semgp.classes import MISSING, Classes
from semgp.picture.colour import GREY
from semgp.viewer import cards
from semgp.viewer.state import Shown, ViewState

if TYPE_CHECKING:
    import viser

UNITS = {"entropy": "nats"}


class Viewer(Protocol):
    """What the controls act on."""

    state: ViewState

    def change(self, **choices: Any) -> None:
        """Make choices of the state anew."""
        ...

    def switch(self, label: int, on: bool) -> None:
        """Switch a class on or off."""
        ...


class Controls:
    """The panel of a live viewer.

    Parameters
    ----------
    server : viser.ViserServer
        Where to put it.
    viewer : Viewer
        What it acts on.
    classes : Classes
        The map's classes.
    fields : sequence of str
        What the points can be coloured by.
    spacing : float
        Spacing of the map's data in metres: the resolution goes from a quarter to ten times of it.
    """

    def __init__(
        self, server: viser.ViserServer, viewer: Viewer, classes: Classes, fields: Sequence[str], spacing: float
    ) -> None:
        gui, self._viewer = server.gui, viewer
        gui.add_html(cards.STYLE)
        self.status = gui.add_html(cards.message("asking the map …"))
        self.progress = gui.add_progress_bar(0, animated=True)
        state = viewer.state
        field = gui.add_dropdown("Colour by", list(fields), initial_value=state.field)
        self._bar = gui.add_html("")
        step = _round_step(spacing / 20)
        low = step * max(1, round(spacing / 4 / step))
        high = step * round(max(10 * spacing, state.resolution) / step)
        at = float(f"{np.clip(step * round(state.resolution / step), low, high):.12g}")
        self.resolution = gui.add_slider("Resolution", low, high, step, at, hint="Metres between points")
        size = gui.add_slider("Point size", 0.3, 3.0, 0.1, 1.0)
        dark = gui.add_checkbox("Dark", False)
        _when(dark, lambda: dress(gui, dark=dark.value))
        self._point = gui.add_folder("Point")
        with self._point:
            self._answer = gui.add_html(cards.message("Click a point of the map to read it."))
        self.layers = gui.add_folder("Layers", visible=False)
        self._legend(gui, classes)
        with gui.add_folder("Section", expand_by_default=False):
            self._section = [gui.add_multi_slider(axis, 0.0, 1.0, 0.01, (0.0, 1.0)) for axis in "xyz"]
        _when(field, lambda: viewer.change(field=field.value))
        _when(size, lambda: viewer.change(size=float(size.value)))
        _when(self.resolution, lambda: viewer.change(resolution=float(self.resolution.value)))
        for slider in self._section:
            _when(slider, self._cut)

    def _legend(self, gui: viser.GuiApi, classes: Classes) -> None:
        viewer, boxes = self._viewer, []
        with gui.add_folder("Classes"):
            buttons = gui.add_button_group("Show", ("all", "none"))
            entries = [*enumerate(zip(classes.names, classes.colours)), (MISSING, ("not observed", GREY))]
            for label, (name, colour) in entries:
                box = gui.add_checkbox(name, label not in viewer.state.hidden)
                gui.add_html(cards.swatch(colour))
                _when(box, partial(self._switch, label, box))
                boxes.append(box)

        def all_or_none() -> None:
            for box in boxes:
                _put(box, buttons.value == "all")
            hidden = [] if buttons.value == "all" else [label for label, _ in entries]
            viewer.change(hidden=frozenset(hidden))

        buttons.on_click(_async(all_or_none))

    def add_layer(self, gui: viser.GuiApi, name: str, show: Callable[[bool], None], on: bool) -> None:
        """Add a check box that shows or hides a layer."""
        self.layers.visible = True
        with self.layers:
            box = gui.add_checkbox(name, on)
        _when(box, lambda: show(box.value))

    def reach(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        """Let the section go from one corner of a box to the other; where it cut nothing, it still doesn't."""
        for axis, slider in enumerate(self._section):
            step = _round_step((high[axis] - low[axis]) / 200 or 0.01)
            a, b = np.floor(low[axis] / step) * step, np.ceil(high[axis] / step) * step
            was = slider.value
            ends = (slider.min, slider.max)
            slider.min, slider.max, slider.step = float(a), float(b), step
            _put(
                slider,
                (
                    float(a) if was[0] <= ends[0] else float(np.clip(was[0], a, b)),
                    float(b) if was[1] >= ends[1] else float(np.clip(was[1], a, b)),
                ),
            )

    def tell(self, text: str, share: float | None = None) -> None:
        """Show a line on what goes on, and how far it is, from 0 to 1; None when it is done."""
        self.status.content = cards.message(text)
        self.progress.visible = share is not None
        _put(self.progress, 100 * (share or 0.0))

    def show(self, shown: Shown, field: str) -> None:
        """Show what the colours mean."""
        self._bar.content = cards.colour_bar(shown.scale, UNITS.get(field, ""))

    def answer(self, content: str) -> None:
        """Show what is known of a point."""
        self._answer.content = content

    def _switch(self, label: int, box: Any) -> None:
        self._viewer.switch(label, box.value)

    def _cut(self) -> None:
        ends = [slider.value for slider in self._section]
        self._viewer.change(
            low=tuple(float(v[0]) if v[0] > s.min else -np.inf for s, v in zip(self._section, ends)),
            high=tuple(float(v[1]) if v[1] < s.max else np.inf for s, v in zip(self._section, ends)),
        )


class PlayControls:
    """Play, step and start again.

    Parameters
    ----------
    server : viser.ViserServer
        Where to put them.
    viewer : Viewer
        What they act on.
    n_scans : int
        How many scans there are.
    """

    def __init__(self, server: viser.ViserServer, viewer: Viewer, n_scans: int) -> None:
        gui, self._viewer, self._n = server.gui, viewer, n_scans
        with gui.add_folder("Playback"):
            self.told = gui.add_html("")
            self.play = gui.add_checkbox("Play", False)
            buttons = gui.add_button_group("Go", ("restart", "step"))
        _when(self.play, lambda: viewer.change() if self.play.value else None)

        def go() -> None:
            _put(self.play, False)
            viewer.change(scans=1 if buttons.value == "restart" else min(viewer.state.scans + 1, n_scans))

        buttons.on_click(_async(go))
        self.tell(viewer.state.scans)

    def tell(self, done: int) -> None:
        """Show how many scans the map has."""
        self.told.content = cards.message(f"{done} of {self._n} scans")

    def go_on(self, done: int) -> None:
        """Ask for the next scan, if it plays; stop at the last."""
        if self.play.value and done < self._n:
            self._viewer.change(scans=done + 1)
        elif self.play.value:
            _put(self.play, False)


def dress(gui: viser.GuiApi, *, dark: bool) -> None:
    """Give the page its looks, without the button that shares it beyond this machine."""
    gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=dark, brand_color=(35, 104, 196))


def _when(handle: Any, act: Callable[[], None]) -> None:
    """Act when a control changes: in the server's loop, so that changes keep their order."""
    handle.on_update(_async(act))


def _put(handle: Any, value: object) -> None:
    """Give a control a value: viser's types call it read-only."""
    handle.value = value


def _async(act: Callable[[], None]) -> Callable[[Any], Any]:
    async def callback(_: Any) -> None:
        act()

    return callback


def _round_step(size: float) -> float:
    """Return 1, 2 or 5 times a power of ten, at most a size."""
    power = 10.0 ** np.floor(np.log10(size))
    return float(f"{max(m * power for m in (1, 2, 5) if m * power <= size * (1 + 1e-9)):.12g}")
