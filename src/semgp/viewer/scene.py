"""What the live viewer draws: viser's scene, filled from plain arrays. All of it is relative to an offset."""

from __future__ import annotations

import contextlib
import io
import socket
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.errors import InputError, MissingExtraError
from semgp.picture.view import View
from semgp.surfaces.mesh import Mesh
from semgp.viewer.layers import Layer, cut_mesh
from semgp.viewer.state import Shown, ViewState, lit

if TYPE_CHECKING:
    import viser

MAP, MESH = "map", "surface"
"""Names of the layers that are no `Layer`."""

_DISC = 1.25
"""Diameter of a point, in distances to the next: discs that turn to the eye then leave no gaps."""


class Scene:
    """The drawing of a map and of what is shown beside it.

    Parameters
    ----------
    server : viser.ViserServer
        Where to draw.
    offset : (3,) array
        What is taken from coordinates in the world, so that float32 keeps their millimetres.
    up : (3,) array
        Upward direction of the world, of length one.
    layers : sequence of Layer
        What is shown beside the map.
    mesh : Mesh, optional
        The map's surface.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        offset: NDArray[np.float64],
        up: NDArray[np.float64],
        layers: Sequence[Layer] = (),
        mesh: Mesh | None = None,
    ) -> None:
        self._server, self._offset, self._up, self._layers, self._mesh = server, offset, up, layers, mesh
        server.scene.set_up_direction(up)

    @property
    def names(self) -> list[str]:
        """Names of all layers, the map's first."""
        return [MAP, *(layer.name for layer in self._layers), *([] if self._mesh is None else [MESH])]

    def look(self, view: View, breadth: float) -> None:
        """Let newcomers begin with a view of a world that is so many metres wide."""
        eye, ahead = view.T_world_camera[:3, 3] - self._offset, view.T_world_camera[:3, 2]
        camera = self._server.initial_camera
        camera.position = eye
        camera.look_at = eye + max(float(-eye @ ahead), 0.1) * ahead
        camera.fov = np.radians(view.fov)
        camera.far = max(1000.0, 20 * breadth)

    def draw(self, shown: Shown, state: ViewState) -> None:
        """Draw what is seen."""
        with self._server.atomic():
            size = _DISC * state.size * shown.sample.resolution
            self._points(f"/{MAP}", shown.points, lit(shown, self._up), size, MAP not in state.off)
            for i, layer in enumerate(self._layers):
                draw = self._cubes if layer.cubes else self._points
                left = layer.within(state)
                draw(f"/layer-{i}", left.points, left.colours, left.edge, layer.name not in state.off)
            if self._mesh is not None:
                self._draw_mesh(self._mesh, state)

    def mark(self, point: NDArray[np.float64], radius: float) -> None:
        """Mark a point with a ball."""
        self._server.scene.add_icosphere(
            "/mark", radius, (225, 0, 110), subdivisions=2, position=point - self._offset
        )

    def in_world(self, point: ArrayLike) -> NDArray[np.float64]:
        """Return a point of the drawing in the world."""
        return np.asarray(np.add(point, self._offset))

    def _points(
        self, name: str, points: NDArray[np.float64], colours: NDArray[np.uint8], size: float, visible: bool
    ) -> None:
        self._server.scene.add_point_cloud(
            name,
            (points - self._offset).astype(np.float32),
            colours,
            point_size=size,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
            visible=visible,
        )

    def _cubes(
        self, name: str, centres: NDArray[np.float64], colours: NDArray[np.uint8], edge: float, visible: bool
    ) -> None:
        vertices, faces = _unit_cube()
        self._server.scene.add_batched_meshes_simple(
            name,
            vertices * np.float32(edge),
            faces,
            batched_wxyzs=np.tile(np.array([1, 0, 0, 0], dtype=np.float32), (len(centres), 1)),
            batched_positions=(centres - self._offset).astype(np.float32),
            batched_colors=colours,
            flat_shading=True,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=visible,
        )

    def _draw_mesh(self, mesh: Mesh, state: ViewState) -> None:
        import trimesh

        drawn = trimesh.Trimesh(
            mesh.vertices - self._offset, cut_mesh(mesh, state), vertex_colors=mesh.colours, process=False
        )
        self._server.scene.add_mesh_trimesh(f"/{MESH}", drawn, visible=MESH not in state.off)


def start_server(host: str, port: int) -> viser.ViserServer:
    """Start viser's server, at this port or not at all.

    Raises
    ------
    InputError
        Nothing can listen there.
    MissingExtraError
        The extra `view` is not installed.
    """
    try:
        import viser
    except ImportError as error:
        raise MissingExtraError("the live viewer", "view") from error
    try:  # viser itself would go on to the next port
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except (OSError, OverflowError) as error:
        problem = getattr(error, "strerror", None) or error
        raise InputError(f"cannot listen at {host}:{port}: {problem}. Give another --port or --host.") from error
    with _silenced():
        return viser.ViserServer(host=host, port=port, verbose=False)


def stop_server(server: viser.ViserServer) -> None:
    """Stop the server and its threads."""
    with _silenced():
        server.stop()


@contextlib.contextmanager
def _silenced() -> Iterator[None]:
    """Keep viser from printing that it starts and stops."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield


def _unit_cube() -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return vertices (8, 3) and faces (12, 3) of the unit cube around the origin."""
    vertices = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return np.array(vertices, dtype=np.float32), np.array(faces, dtype=np.uint32)
