"""A map in the browser, asked live: choices come in, the map is asked anew where need be, and drawn."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from semgp.errors import InputError, SemgpError
from semgp.maps.protocol import SemanticMap
from semgp.maps.settings import require_positive
from semgp.picture.view import view_of
from semgp.surfaces.mesh import Mesh
from semgp.upward import Up, direction
from semgp.viewer import cards
from semgp.viewer.controls import Controls, PlayControls, dress
from semgp.viewer.fields import CLASS, field_called, field_names
from semgp.viewer.layers import Layer
from semgp.viewer.playback import Playback
from semgp.viewer.scene import MAP, Scene, start_server, stop_server
from semgp.viewer.state import Progress, Sample, Shown, ViewState, pick, show, take_sample
from semgp.viewer.surface import Surface
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
        How far apart the points are at first, metres; left out, the spacing of the map's data.
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
        if most < 1:
            raise InputError(f"a viewer shows at least one point, not {most}.")
        self._playback = source if isinstance(source, Playback) else None
        self._map = source.begin() if isinstance(source, Playback) else source
        self._surface, upward = Surface(self._map.positions), direction(up or self._map.up)
        probe = self._map.query(self._surface.positions[:1])
        spacing, breadth = self._surface.spacing, float(np.linalg.norm(self._surface.high - self._surface.low))
        self.state = ViewState(
            resolution=spacing if resolution is None else require_positive("resolution", resolution),
            field=field_called(probe, field),
            hidden=frozenset(self._map.classes.index(name) for name in hide),
            scans=0 if self._playback is None else self._playback.done,
        )
        self._most, self._lock, self._changed = most, threading.Lock(), threading.Condition()
        self._shown: Shown | None = None
        self._drawn: ViewState | None = None
        self._server = start_server(host, port)
        dress(self._server.gui, dark=False)
        self._server.gui.set_panel_label(title)
        self._worker = Latest(self._work, self._failed)
        self._scene = Scene(self._server, np.round(self._surface.positions.mean(axis=0)), upward, layers, mesh)
        self._scene.look(view_of(self._surface.positions, up=upward), breadth)
        self._server.scene.on_click()(self._click)
        beside = [name for name in self._scene.names if name != MAP]
        self.state = replace(self.state, off=frozenset(beside))
        self._controls = Controls(self._server, self, self._map.classes, field_names(probe), spacing)
        self._play = None if self._playback is None else PlayControls(self._server, self, len(self._playback))
        self._controls.reach(self._surface.low, self._surface.high)
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

    def read(self, origin: ArrayLike, direction: ArrayLike) -> int | None:
        """Show what the map says where a ray meets it, world frame; return the row of the sample, or None."""
        shown = self._shown
        row = None if shown is None else pick(shown, origin, direction)
        if shown is None or row is None:
            return None
        self._controls.answer(cards.answer(shown.sample, row))
        self._scene.mark(shown.sample.points[row], 1.5 * shown.sample.resolution)
        return row

    def close(self) -> None:
        """Stop the server and the work."""
        self._worker.close()
        stop_server(self._server)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _click(self, event: viser.SceneClickEvent) -> None:
        self.read(self._scene.in_world(event.ray_origin), event.ray_direction)

    def _failed(self, error: SemgpError) -> None:
        self._controls.tell(f"error: {error}")

    def _work(self, state: ViewState) -> None:
        """Bring the picture to a state: add scans and ask the map if need be, then colour, cut and draw."""
        if self._playback is not None and self._playback.done != state.scans:
            self._grow(self._playback, state)
        before = self._drawn
        if before is None or self._shown is None or _asks(before) != _asks(state):
            sample = take_sample(self._map, self._surface, state.resolution, self._most, self._report(state))
        else:
            sample = self._shown.sample
        self._shown = show(sample, state)
        self._scene.draw(self._shown, state)
        self._controls.show(self._shown, state.field)
        self._controls.tell(_told(sample, len(self._shown.rows), state))
        with self._changed:
            self._drawn = state
            self._changed.notify_all()
        if self._play is not None:
            self._play.go_on(state.scans)

    def _grow(self, playback: Playback, state: ViewState) -> None:
        playback.go_to(state.scans, lambda n, total: self._controls.tell(f"adding scan {n + 1}", n / total))
        self._map, self._surface = playback.semantic_map, Surface(playback.semantic_map.positions)
        self._controls.reach(self._surface.low, self._surface.high)
        assert self._play is not None
        self._play.tell(playback.done)

    def _report(self, state: ViewState) -> Progress:
        """Return what reports progress, and gives up once another resolution or scan is wanted."""

        def report(n: int, total: int) -> None:
            if self._worker.closed or _asks(self.state) != _asks(state):
                raise SupersededError
            self._controls.tell(f"asking the map: {n:,} of {total:,} points", n / max(total, 1))

        return report


def _asks(state: ViewState) -> tuple[float, int]:
    """Return the choices for which the map is asked anew."""
    return state.resolution, state.scans


def _told(sample: Sample, seen: int, state: ViewState) -> str:
    coarser = (
        "" if sample.resolution == state.resolution else f", as there is no room for {state.resolution:.3g} m"
    )
    return f"{seen:,} of {len(sample.points):,} points, every {sample.resolution:.3g} m{coarser}"
