"""The controls of playback in the live viewer's panel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semgp.viewer import cards
from semgp.viewer.widgets import Viewer, in_loop, put, when

if TYPE_CHECKING:
    import viser


class Player:
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
        when(self.play, lambda: viewer.change() if self.play.value else None)

        def go() -> None:
            put(self.play, False)
            viewer.change(scans=1 if buttons.value == "restart" else min(viewer.state.scans + 1, n_scans))

        buttons.on_click(in_loop(go))
        self.tell(viewer.state.scans)

    def tell(self, done: int) -> None:
        """Show how many scans the map has."""
        self.told.content = cards.message(f"{done} of {self._n} scans")

    def go_on(self, done: int) -> None:
        """Ask for the next scan, if it plays; stop at the last."""
        if self.play.value and done < self._n:
            self._viewer.change(scans=done + 1)
        elif self.play.value:
            put(self.play, False)
