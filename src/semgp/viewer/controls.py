"""The live viewer's panel: what each control changes of the view's state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.viewer import cards
from semgp.viewer.legend import Legend
from semgp.viewer.state import Shown
from semgp.viewer.widgets import Viewer, dress, put, round_step, when

if TYPE_CHECKING:
    import viser

UNITS = {"entropy": "nats"}


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
        field = gui.add_dropdown("Colour by", list(fields), initial_value=viewer.state.field)
        self._bar = gui.add_html("")
        self._add_sliders(gui, spacing)
        inside = gui.add_checkbox("See inside", viewer.state.see_inside, hint=_INSIDE)
        dark = gui.add_checkbox("Dark", False)
        self._point = gui.add_folder("Point")
        with self._point:
            self._answer = gui.add_html(cards.message("Click a point of the map to read it."))
        self.layers = gui.add_folder("Layers", visible=False)
        self.legend = Legend(gui, viewer, classes)
        with gui.add_folder("Section", expand_by_default=False):
            self._section = [gui.add_multi_slider(axis, 0.0, 1.0, 0.01, (0.0, 1.0)) for axis in "xyz"]
            self._left = gui.add_html("")
        when(field, lambda: viewer.change(field=field.value))
        when(inside, lambda: viewer.change(see_inside=inside.value))
        when(dark, lambda: dress(gui, dark=dark.value))
        for slider in self._section:
            when(slider, self._cut)

    def _add_sliders(self, gui: viser.GuiApi, spacing: float) -> None:
        wanted, usual = 100 * self._viewer.state.resolution, 100 * spacing
        step = round_step(usual / 20)
        low = step * max(1, round(usual / 4 / step))
        high = step * round(max(10 * usual, wanted) / step)
        at = float(f"{np.clip(step * round(wanted / step), low, high):.12g}")
        self.resolution = gui.add_slider("Resolution, cm", low, high, step, at, hint="Distance between points")
        size = gui.add_slider("Point size", 0.3, 3.0, 0.1, 1.0)
        when(size, lambda: self._viewer.change(size=float(size.value)))
        when(self.resolution, lambda: self._viewer.change(resolution=float(self.resolution.value) / 100))

    def add_layer(self, gui: viser.GuiApi, name: str, show: Callable[[bool], None], on: bool) -> None:
        """Add a check box that shows or hides a layer."""
        self.layers.visible = True
        with self.layers:
            box = gui.add_checkbox(name, on)
        when(box, lambda: show(box.value))

    def reach(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        """Let the section go from one corner of a box to the other; where it cut nothing, it still doesn't."""
        for axis, slider in enumerate(self._section):
            step = round_step((high[axis] - low[axis]) / 200 or 0.01)
            a, b = np.floor(low[axis] / step) * step, np.ceil(high[axis] / step) * step
            was = slider.value
            ends = (slider.min, slider.max)
            slider.min, slider.max, slider.step = float(a), float(b), step
            put(
                slider,
                (
                    float(a) if was[0] <= ends[0] else float(np.clip(was[0], a, b)),
                    float(b) if was[1] >= ends[1] else float(np.clip(was[1], a, b)),
                ),
            )
        self._tell_section()

    def tell(self, text: str, share: float | None = None) -> None:
        """Show a line on what goes on, and how far it is, from 0 to 1; None when it is done."""
        self.status.content = cards.message(text)
        self.progress.visible = share is not None
        put(self.progress, 100 * (share or 0.0))

    def show(self, shown: Shown, field: str) -> None:
        """Show what the colours mean, and which classes occur."""
        self._bar.content = cards.colour_bar(shown.scale, UNITS.get(field, ""))
        self.legend.show(shown.sample.shares())

    def answer(self, content: str) -> None:
        """Show what is known of a point."""
        self._answer.content = content

    def _tell_section(self) -> None:
        left = [
            f"{axis} {s.value[0]:.2f} to {s.value[1]:.2f} m"
            for axis, s in zip("xyz", self._section)
            if tuple(s.value) != (s.min, s.max)
        ]
        self._left.content = cards.message(" · ".join(left) or "nothing is cut away")

    def _cut(self) -> None:
        self._tell_section()
        ends = [slider.value for slider in self._section]
        self._viewer.change(
            low=tuple(float(v[0]) if v[0] > s.min else -np.inf for s, v in zip(self._section, ends)),
            high=tuple(float(v[1]) if v[1] < s.max else np.inf for s, v in zip(self._section, ends)),
        )


_INSIDE = "From outside, look into rooms: walls are seen from within only"
