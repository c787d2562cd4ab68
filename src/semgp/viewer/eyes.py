"""The map as each browser sees it: from outside, without the walls that turn their back, so that one looks in."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semgp.errors import SemgpError
from semgp.viewer.sight import backs
from semgp.viewer.state import Shown
from semgp.viewer.worker import Latest

if TYPE_CHECKING:
    import viser

_STALE = 1 / 500
"""Share of the points that may be seen wrongly before a camera that has moved is sent them anew."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """What there is to see of the map.

    Parameters
    ----------
    shown : Shown
        The points.
    colours : (K, 3) uint8 array
        Their colours, lit.
    size : float
        Their diameter, metres.
    visible : bool
        Whether the map is shown at all.
    see_inside : bool
        Whether the backs of walls are left out.
    """

    shown: Shown
    colours: NDArray[np.uint8]
    size: float
    visible: bool
    see_inside: bool


class Eyes:
    """Draws the map for each browser, and anew as its camera moves round walls.

    Parameters
    ----------
    server : viser.ViserServer
        Where to draw.
    name : str
        What to call the points there.
    offset : (3,) array
        What is taken from coordinates in the world.
    failed : callable
        Takes errors of drawing.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        name: str,
        offset: NDArray[np.float64],
        failed: Callable[[SemgpError], None],
    ) -> None:
        self._server, self._name, self._offset = server, name, offset
        self._drawing: Drawing | None = None
        self._kept: dict[int, NDArray[np.bool_]] = {}
        self._lock = threading.Lock()
        self._follower: Latest[None] = Latest(lambda _: self._follow(), failed)
        self._follower.start()
        server.on_client_connect(self._welcome)

    def draw(self, drawing: Drawing) -> None:
        """Draw it for all who look."""
        with self._lock:
            self._drawing = drawing
            self._kept.clear()
            self._draw_for_all(drawing)

    def close(self) -> None:
        """Follow no camera any longer."""
        self._follower.close()

    async def _welcome(self, client: viser.ClientHandle) -> None:
        async def moved(_: viser.CameraHandle) -> None:
            self._follower.request(None)

        client.camera.on_update(moved)
        self._follower.request(None)

    def _follow(self) -> None:
        with self._lock:
            if self._drawing is not None:
                self._draw_for_all(self._drawing)

    def _draw_for_all(self, drawing: Drawing) -> None:
        clients = self._server.get_clients()
        for number, client in clients.items():
            keep = self._seen(drawing, client)
            before = self._kept.get(number)
            if before is None or np.count_nonzero(keep != before) > _STALE * len(keep):
                self._kept[number] = keep
                self._send(drawing, client, keep)
        self._kept = {number: kept for number, kept in self._kept.items() if number in clients}

    def _seen(self, drawing: Drawing, client: viser.ClientHandle) -> NDArray[np.bool_]:
        if not drawing.see_inside:
            return np.ones(len(drawing.shown.rows), dtype=bool)
        return ~backs(drawing.shown, client.camera.position + self._offset)

    def _send(self, drawing: Drawing, client: viser.ClientHandle, keep: NDArray[np.bool_]) -> None:
        points = drawing.shown.points[keep] - self._offset
        add_points(client.scene, self._name, points, drawing.colours[keep], drawing.size, drawing.visible)


def add_points(
    scene: viser.SceneApi,
    name: str,
    points: NDArray[np.float64],
    colours: NDArray[np.uint8],
    size: float,
    visible: bool,
) -> None:
    """Draw points (N, 3) as discs that turn to the eye, in place of what has the name."""
    scene.add_point_cloud(
        name,
        points.astype(np.float32),
        colours,
        point_size=size,
        point_shape="circle",
        point_shading="flat",
        precision="float32",
        visible=visible,
    )
