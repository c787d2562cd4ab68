"""What the live viewer draws: viser's scene, filled from plain arrays. All of it is relative to an offset."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.errors import SemgpError
from semgp.picture.view import view_of
from semgp.surfaces.glb import linear
from semgp.surfaces.mesh import Mesh
from semgp.viewer.eyes import Drawing, Eyes, add_points
from semgp.viewer.layers import Layer, cut_mesh
from semgp.viewer.sight import lit
from semgp.viewer.state import Shown, ViewState
from semgp.viewer.surface import Surface

if TYPE_CHECKING:
    import viser

MAP, MESH = "map", "surface"
"""Names of the layers that are no `Layer`."""

_DISC = 1.25
"""Diameter of a point, in distances to the next: discs that turn to the eye then leave no gaps."""

_BACK = 1.15
"""Distance of the first view, in those at which the map fills the frame."""


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
    failed : callable
        Takes errors of drawing for a camera that moves.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        offset: NDArray[np.float64],
        up: NDArray[np.float64],
        layers: Sequence[Layer],
        mesh: Mesh | None,
        failed: Callable[[SemgpError], None],
    ) -> None:
        self._server, self._offset, self._up, self._layers, self._mesh = server, offset, up, layers, mesh
        self._eyes = Eyes(server, f"/{MAP}", offset, failed)
        server.scene.set_up_direction(up)

    @property
    def names(self) -> list[str]:
        """Names of all layers, the map's first."""
        return [MAP, *(layer.name for layer in self._layers), *([] if self._mesh is None else [MESH])]

    def look_at(self, surface: Surface) -> None:
        """Let newcomers, and whoever resets the view, see all of a surface."""
        view = view_of(surface.positions, up=self._up)
        eye, ahead = view.T_world_camera[:3, 3] - self._offset, view.T_world_camera[:3, 2]
        camera, distance = self._server.initial_camera, max(float(-eye @ ahead), 0.1)
        camera.position = eye - (_BACK - 1) * distance * ahead
        camera.look_at = eye + distance * ahead
        camera.fov = np.radians(view.fov)
        camera.far = max(1000.0, 20 * float(np.linalg.norm(surface.high - surface.low)))

    def draw(self, shown: Shown, state: ViewState) -> None:
        """Draw what is seen."""
        with self._server.atomic():
            size = _DISC * state.size * shown.sample.resolution
            self._eyes.draw(Drawing(shown, lit(shown, self._up), size, MAP not in state.off, state.see_inside))
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

    def close(self) -> None:
        """Stop drawing."""
        self._eyes.close()

    def in_world(self, point: ArrayLike) -> NDArray[np.float64]:
        """Return a point of the drawing in the world."""
        return np.asarray(np.add(point, self._offset))

    def _points(
        self, name: str, points: NDArray[np.float64], colours: NDArray[np.uint8], size: float, visible: bool
    ) -> None:
        add_points(self._server.scene, name, points - self._offset, colours, size, visible)

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
            mesh.vertices - self._offset,
            cut_mesh(mesh, state),
            vertex_normals=mesh.normals,
            vertex_colors=linear(mesh.colours),
            process=False,
        )
        self._server.scene.add_mesh_trimesh(f"/{MESH}", drawn, visible=MESH not in state.off)


def _unit_cube() -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return vertices (8, 3) and faces (12, 3) of the unit cube around the origin."""
    vertices = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return np.array(vertices, dtype=np.float32), np.array(faces, dtype=np.uint32)
