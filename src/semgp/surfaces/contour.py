"""From a field on a lattice to triangles: marching cubes, brick by brick, seamless."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgp.errors import MissingExtraError
from semgp.parallel import slices
from semgp.surfaces.lattice import Lattice

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_BATCH = 4096  # bricks at once
_UNKNOWN = -1.0  # counts as free; faces that reach there are dropped


class Sheet(NamedTuple):
    """Triangles in the local frame of a lattice, metres.

    vertices (V, 3): each on an edge between two nodes. inner (V, 3): the one of the two that is inside.
    edges (V,): a number for that edge. faces (F, 3): anticlockwise as seen from outside.
    """

    vertices: F64
    inner: F64
    edges: I64
    faces: I64

    def only(self, kept: NDArray[np.bool_]) -> Sheet:
        """Return the faces whose three vertices are among those kept (V,), and their vertices."""
        faces = self.faces[kept[self.faces].all(axis=1)]
        used, renumbered = np.unique(faces, return_inverse=True)
        return Sheet(self.vertices[used], self.inner[used], self.edges[used], renumbered.reshape(-1, 3))


def require_marching_cubes() -> Callable[..., Any]:
    """Return scikit-image's marching cubes.

    Raises
    ------
    MissingExtraError
        The extra `mesh` is not installed.
    """
    try:
        from skimage.measure import marching_cubes
    except ImportError as error:
        raise MissingExtraError("making a mesh", "mesh") from error
    found: Callable[..., Any] = marching_cubes
    return found


def contour(lattice: Lattice, values: F32) -> Sheet:
    """Return the surface between positive and negative values, without the faces that meet nodes without value.

    Which faces a cube has follows from the signs at its corners, by the classic table (Lorensen and Cline, 1987,
    as scikit-image has it): so neighbours agree, in one brick and across two. Lewiner's variant compares products
    of values, and leaves doubled faces where they tie. A vertex is known by the edge between two nodes that it
    lies on, and its place on it is computed here, in double precision.

    Parameters
    ----------
    lattice : Lattice
        B bricks.
    values : (B, cells, cells, cells) array
        Never zero; NaN where not known.
    """
    parts = [_contour_of_bricks(lattice, values, part) for part in slices(len(lattice), _BATCH)]
    if not parts:
        return _EMPTY
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts)])
    vertices, inner, edges = (np.concatenate([part[i] for part in parts]) for i in range(3))
    edges, first, vertex = np.unique(edges, return_index=True, return_inverse=True)
    return Sheet(vertices[first], inner[first], edges, vertex[faces])


def _contour_of_bricks(lattice: Lattice, values: F32, part: slice) -> Sheet:
    marching_cubes = require_marching_cubes()
    rows = lattice.neighbours(part)
    blocks = _closed_bricks(values, rows)
    crossed = np.flatnonzero((blocks > 0).any(axis=(1, 2, 3)) & (blocks < 0).any(axis=(1, 2, 3)))
    if not len(crossed):
        return _EMPTY
    filled = np.where(np.isnan(blocks[crossed]), _UNKNOWN, blocks[crossed])
    # "ascent" is what scikit-image calls faces anticlockwise as seen from the lower values.
    meshes = [marching_cubes(block, 0.0, method="lorensen", gradient_direction="ascent")[:2] for block in filled]
    n_vertices, n_faces = ([len(mesh[i]) for mesh in meshes] for i in range(2))
    starts = np.cumsum([0, *n_vertices[:-1]])
    faces = np.concatenate([mesh[1] for mesh in meshes]) + np.repeat(starts, n_faces)[:, None]
    places = np.concatenate([mesh[0] for mesh in meshes])
    return _sheet(lattice, part, blocks, rows, np.repeat(crossed, n_vertices), places, faces)


def _closed_bricks(values: F32, rows: I64) -> F32:
    """Return bricks with their neighbours' first nodes (B, cells + 1, ...); NaN where there are no neighbours."""
    n = values.shape[1]
    blocks = np.full((len(rows), n + 1, n + 1, n + 1), np.nan, dtype=np.float32)
    for x, y, z in product((0, 1), repeat=3):
        row = rows[:, x, y, z]
        there = np.flatnonzero(row >= 0)
        i, j, k = (slice(n, n + 1) if upper else slice(0, n) for upper in (x, y, z))
        u, v, w = (slice(0, 1) if upper else slice(0, n) for upper in (x, y, z))
        blocks[there, i, j, k] = values[row[there], u, v, w]
    return blocks


def _sheet(lattice: Lattice, part: slice, blocks: F32, rows: I64, brick: I64, places: F32, faces: I64) -> Sheet:
    """Return what marching cubes found at `places` (V, 3), in nodes from the first one of each `brick` (V,)."""
    n = lattice.cells
    node = np.floor(places).astype(np.int64)
    axis = (places > node).argmax(axis=1)
    step = np.eye(3, dtype=np.int64)[axis]
    g, h = (blocks[brick, *ends.T].astype(np.float64)[:, None] for ends in (node, node + step))
    at = lattice.first_nodes(part)[brick] + node
    vertices, inner = (at + step * g / (g - h)) * lattice.resolution, (at + step * (g < 0)) * lattice.resolution
    owner = rows[brick, *(node // n).T]
    edges = (owner * n**3 + np.ravel_multi_index(tuple((node % n).T), (n, n, n))) * 3 + axis
    return Sheet(vertices, inner, edges, faces).only(np.isfinite(vertices).all(axis=1))


_EMPTY = Sheet(np.empty((0, 3)), np.empty((0, 3)), np.empty(0, np.int64), np.empty((0, 3), np.int64))
