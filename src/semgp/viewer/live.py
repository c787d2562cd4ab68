"""A map in the browser, asked live: choices come in, the map is asked anew where need be, and drawn."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from semgp.errors import SemgpError
from semgp.maps.protocol import SemanticMap
from semgp.surfaces.mesh import Mesh
from semgp.upward import Up, direction
from semgp.viewer import cards
from semgp.viewer.controls import Controls
from semgp.viewer.fields import CLASS, field_names
from semgp.viewer.layers import Layer
from semgp.viewer.playback import Playback
from semgp.viewer.player import Player
from semgp.viewer.scene import MAP, MESH, Scene
from semgp.viewer.server import start_server, stop_server
from semgp.viewer.sight import pick
from semgp.viewer.source import Source, Tell, asks
from semgp.viewer.state import Shown, ViewState, show
from semgp.viewer.widgets import furnish
from semgp.viewer.worker import Latest, SupersededError

if TYPE_CHECKING:
    import viser

MOST_POINTS = 300_000
"""Points that a browser is given at once, unless told."""

LOCAL = "127.0.0.1"


class LiveViewer:
    """A server that shows a map in the browser until it is closed; also a context manager.

    Parameters
    ----------
    source : SemanticMap or Playback
        The map, or how it is built.
    title : str
        Heading of the panel.
    host, port : str, int
        Where to listen; by default only this machine can connect. Port 0 is any that is free.
    resolution : float, optional
        How far apart the points are at first, metres; left out, half the spacing of the data if they fit.
    field : str
        What the points are coloured by at first, see `semgp.viewer.fields`.
    hide : iterable of str
        Classes that are off at first.
    up : str, optional
        The axis of the world that points upwards, see `semgp.upward`; left out, what the map says.
    most : int
        The most points that are shown at once.
    layers : sequence of Layer
        What is shown beside the map.
    mesh : Mesh, optional
        The map's surface.

    Raises
    ------
    InputError
        An empty map, a class or field that it does not have, or a port that is taken.
    MissingExtraError
        The extra `view` is not installed.
    """

    def __init__(
        self,
        source: SemanticMap | Playback,
        *,
        title: str = "semgp",
        host: str = LOCAL,
        port: int = 8080,
        resolution: float | None = None,
        field: str = CLASS,
        hide: Iterable[str] = (),
        up: Up | None = None,
        most: int = MOST_POINTS,
        layers: Sequence[Layer] = (),
        mesh: Mesh | None = None,
    ) -> None:
        self._source = Source(source, most)
        surface, classes = self._source.surface, self._source.semantic_map.classes
        upward = direction(up or self._source.semantic_map.up)
        beside = [*(layer.name for layer in layers), *([] if mesh is None else [MESH])]
        self.state = self._source.first_state(resolution, field, hide, beside)
        self._lock, self._changed = threading.Lock(), threading.Condition()
        self._shown: Shown | None = None
        self._drawn: ViewState | None = None
        self._server = start_server(host, port)
        furnish(self._server.gui, title)
        self._worker = Latest(self._work, self._failed)
        middle = np.round(surface.positions.mean(axis=0))
        self._scene = Scene(self._server, middle, upward, layers, mesh, self._failed)
        self._scene.look_at(surface)
        self._server.scene.on_click()(self._click)
        playback = self._source.playback
        self._player = None if playback is None else Player(self._server, self, len(playback))
        self._controls = Controls(self._server, self, classes, field_names(self._source.probe), surface.spacing)
        self._controls.reach(surface.low, surface.high)
        for name in self._scene.names if beside else []:
            self._controls.add_layer(self._server.gui, name, partial(self.switch_layer, name), name == MAP)
        self._worker.request(self.state)
        self._worker.start()

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{self._server.get_host()}:{self._server.get_port()}"

    @property
    def shown(self) -> Shown | None:
        """What is seen of the map; None until it has been asked."""
        return self._shown

    def change(self, **choices: Any) -> None:
        """Make choices of the state anew, such as `resolution=0.05`; the picture follows."""
        with self._lock:
            self.state = replace(self.state, **choices)
            self._worker.request(self.state)

    def switch(self, label: int, on: bool) -> None:
        """Switch a class on or off."""
        with self._lock:
            self.state = self.state.switched(label, on)
            self._worker.request(self.state)

    def switch_layer(self, name: str, on: bool) -> None:
        """Show or hide a layer."""
        self.change(off=self.state.off - {name} if on else self.state.off | {name})

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the picture is that of the state; False if that takes longer than so many seconds."""
        with self._changed:
            return self._changed.wait_for(lambda: self._drawn is self.state, timeout)

    def read(self, origin: ArrayLike, ahead: ArrayLike) -> int | None:
        """Show what the map says where a ray meets it, world frame; return the row of the sample, or None."""
        shown = self._shown
        row = None if shown is None else pick(shown, origin, ahead, see_inside=self.state.see_inside)
        if shown is None or row is None:
            return None
        self._controls.answer(cards.answer(shown.sample, row))
        self._scene.mark(shown.sample.points[row], 1.5 * shown.sample.resolution)
        return row

    def close(self) -> None:
        """Stop the server and the work."""
        self._worker.close()
        self._scene.close()
        stop_server(self._server)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _click(self, event: viser.SceneClickEvent) -> None:
        self.read(self._scene.in_world(event.ray_origin), event.ray_direction)

    def _failed(self, error: SemgpError) -> None:
        self._controls.tell(f"error: {error}")

    def _work(self, state: ViewState) -> None:
        """Bring the picture to a state: add scans and ask the map if need be, then colour, cut and draw."""
        before = self._source.surface
        sample = self._source.sample(state, self._report(state))
        if self._player is not None and (surface := self._source.surface) is not before:
            self._controls.reach(surface.low, surface.high)
            self._scene.look_at(surface)
            self._player.tell(state.scans)
        self._shown = show(sample, state)
        self._scene.draw(self._shown, state)
        self._controls.show(self._shown, state.field)
        self._controls.tell(cards.told(sample, len(self._shown.rows), state.resolution))
        with self._changed:
            self._drawn = state
            self._changed.notify_all()
        if self._player is not None:
            self._player.go_on(state.scans)

    def _report(self, state: ViewState) -> Tell:
        """Return what tells progress, and gives up once another resolution or scan is wanted."""

        def report(text: str, share: float) -> None:
            if self._worker.closed or asks(self.state) != asks(state):
                raise SupersededError
            self._controls.tell(text, share)

        return report
