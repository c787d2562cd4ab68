"""The classes in the live viewer's panel: those that occur, most points first, each with its share."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from semgp.classes import MISSING, Classes
from semgp.picture.colour import GREY
from semgp.viewer import cards
from semgp.viewer.widgets import Viewer, in_loop, put, when

if TYPE_CHECKING:
    import viser


class Legend:
    """Check boxes that switch classes on and off.

    A class keeps its box, and whether it is on, while it does not occur.

    Parameters
    ----------
    gui : viser.GuiApi
        Where to put it.
    viewer : Viewer
        What it acts on.
    classes : Classes
        The map's classes.
    """

    def __init__(self, gui: viser.GuiApi, viewer: Viewer, classes: Classes) -> None:
        self._gui, self._viewer, self._classes = gui, viewer, classes
        self._rows: dict[int, tuple[Any, Any]] = {}
        self._folder = gui.add_folder("Classes")
        with self._folder:
            self._buttons = gui.add_button_group("Show", ("all", "none"))
        self._buttons.order = -1.0
        self._buttons.on_click(in_loop(self._all_or_none))

    def show(self, shares: Sequence[tuple[int, float]]) -> None:
        """List labels with their shares of the points, in this order, and no others."""
        for place, (label, share) in enumerate(shares):
            box, swatch = self._row(label)
            box.order, swatch.order = 2.0 * place, 2.0 * place + 1
            swatch.content = cards.swatch(self._entry(label)[1], share)
        listed = {label for label, _ in shares}
        for label, row in self._rows.items():
            for part in row:
                part.visible = label in listed

    def _row(self, label: int) -> tuple[Any, Any]:
        if label not in self._rows:
            with self._folder:
                box = self._gui.add_checkbox(self._entry(label)[0], label not in self._viewer.state.hidden)
                self._rows[label] = box, self._gui.add_html("")
            when(box, partial(self._switch, label, box))
        return self._rows[label]

    def _entry(self, label: int) -> tuple[str, tuple[int, int, int]]:
        """Return name and colour of a label."""
        return (
            ("not observed", GREY)
            if label == MISSING
            else (self._classes.names[label], self._classes.colours[label])
        )

    def _switch(self, label: int, box: Any) -> None:
        self._viewer.switch(label, box.value)

    def _all_or_none(self) -> None:
        on = self._buttons.value == "all"
        for box, _ in self._rows.values():
            put(box, on)
        self._viewer.change(hidden=frozenset() if on else frozenset(range(MISSING, len(self._classes))))
