"""The surface of a map as a mesh."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.maps.protocol import BATCH, NO_FREE_SPACE, SpatialMap
from semgp.maps.settings import require_positive
from semgp.parallel import slices
from semgp.surfaces.contour import contour, require_marching_cubes
from semgp.surfaces.evidence import seen
from semgp.surfaces.field import Progress, lattice_field
from semgp.surfaces.lattice import box_between, lattice_near
from semgp.surfaces.mesh import Mesh, vertex_normals

F64 = NDArray[np.float64]


def surface(
    semantic_map: SpatialMap,
    what: str = "occupied",
    *,
    resolution: float,
    level: float = 0.5,
    low: ArrayLike | None = None,
    high: ArrayLike | None = None,
    progress: Progress | None = None,
) -> Mesh:
    """Return the surface on which a map's continuous field crosses a level, as far as it has been seen.

    The map is asked on a lattice near `occupied_positions`, and marching cubes finds the surface between its
    nodes. Where a map knows nothing it answers its prior, which may be the level itself. So what is not known, or
    was seen from no side, is left open: a face stays where the map knows the nodes next to it, where rays ended
    within `evidence.REACH` voxels, and where rays passed within `evidence.AHEAD` voxels on the side to which its
    normal points. A wall seen from one side is one sheet. Voxels are the map's, or the lattice's where they are
    larger.

    Parameters
    ----------
    semantic_map : SpatialMap
        A map that keeps free space.
    what : str
        "occupied" for the probability that something is there, or the name of a class for the probability that
        something of it is there: the surface then ends a few voxels inside of things where another class begins.
    resolution : float
        Spacing of the lattice in metres, any: the nodes are the centres of the voxels of that edge. Things thinner
        than that may be missed, and where rays end, an OctoMap is occupied no deeper than one of its voxels.
    level : float, optional
        Probability on the surface, between 0 and 1.
    low, high : (3,) array, optional
        Corners of a box that the mesh stays in, metres.
    progress : callable, optional
        Called with the number of bricks of the lattice that are done and of all.

    Returns
    -------
    Mesh
        Without faces if nothing crosses the level. Label and uncertainty are the map's at the vertices; where it
        has no label there, as in a free voxel beside an occupied one, those at the node next to it that is inside.

    Raises
    ------
    InputError
        A map that is empty or keeps no free space, a class that it does not have, a resolution, level or box out
        of range, or more than `lattice.MOST_NODES` nodes.
    MissingExtraError
        The extra `mesh` is not installed.

    References
    ----------
    Lorensen and Cline (1987), "Marching cubes: a high resolution 3D surface construction algorithm", SIGGRAPH.
    """
    require_marching_cubes()
    resolution = require_positive("resolution", resolution)
    if not (math.isfinite(level) and 0 < level < 1):
        raise InputError(f"the level must be a probability between 0 and 1, not {level}.")
    class_ = None if what == "occupied" else _class_called(what, semantic_map)
    box = box_between(low, high)
    occupied, free = _evidence(semantic_map)
    voxel = max(semantic_map.resolution, resolution)
    lattice = lattice_near(occupied, resolution, voxel, box)
    sheet = contour(lattice, lattice_field(semantic_map, lattice, class_, level, box, progress))
    normals = vertex_normals(sheet.vertices, sheet.faces)
    sheet = sheet.only(seen(lattice.corner + sheet.vertices, normals, occupied, free, voxel))
    vertices, inner = lattice.corner + sheet.vertices, lattice.corner + sheet.inner
    label, probability, entropy, *variance = _answers(semantic_map, vertices, inner)
    return Mesh(
        semantic_map.classes,
        vertices,
        sheet.faces.astype(np.int32),
        vertex_normals(sheet.vertices, sheet.faces),
        label,
        probability,
        entropy,
        variance[0] if variance else None,
        semantic_map.up,
    )


def _class_called(name: str, semantic_map: SpatialMap) -> int:
    if name not in semantic_map.classes.names:
        known = ", ".join(semantic_map.classes.names)
        raise InputError(f"no class is called {name!r}: a surface is that of 'occupied' or of a class of {known}.")
    return semantic_map.classes.index(name)


def _evidence(semantic_map: SpatialMap) -> tuple[F64, F64]:
    """Return where rays ended and where they passed."""
    if not isinstance(semantic_map, SpatialMap):
        raise InputError(NO_FREE_SPACE)
    occupied, free = semantic_map.occupied_positions, semantic_map.free_positions
    if not len(occupied):
        raise InputError("the map is empty, nothing in it is occupied: update it with clouds first.")
    if not len(free):
        raise InputError(NO_FREE_SPACE)
    return occupied, free


def _answers(semantic_map: SpatialMap, vertices: F64, inner: F64) -> list[NDArray[Any]]:
    """Return label, its probability, entropy and, where the map has it, variance; at `inner` where labels lack."""
    columns = _columns(semantic_map, vertices)
    missing = columns[0] == MISSING
    for column, within in zip(columns, _columns(semantic_map, inner[missing])):
        column[missing] = within
    return columns


def _columns(semantic_map: SpatialMap, points: F64) -> list[NDArray[Any]]:
    parts = []
    for part in slices(len(points), BATCH) if len(points) else [slice(0)]:
        answer = semantic_map.query(points[part])
        top = np.arange(len(answer)), answer.probability.argmax(axis=1)
        variance = [] if answer.variance is None else [answer.variance[top]]
        parts.append([answer.label, answer.confidence, answer.entropy, *variance])
    return [np.concatenate(column) for column in zip(*parts)]
