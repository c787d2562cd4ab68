"""The lattice on which a surface is looked for: bricks of nodes near what rays have hit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.checks import as_array
from semgp.errors import InputError
from semgp.surfaces.evidence import REACH
from semgp.voxels import STEP, VoxelTable, voxel_centres, voxel_indices, voxel_keys, voxel_origin

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

CELLS = 8
"""Nodes along each edge of a brick."""

MOST_NODES = 100_000_000
"""A lattice of more nodes is refused: a map would be asked for minutes, and 0.4 GB would hold the answers."""


@dataclass(frozen=True, eq=False)
class Box:
    """What lies between two corners (3,), in metres; infinite where there is no limit."""

    low: F64
    high: F64

    def holds(self, points: F64, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return which points (M, 3) lie in the box or within a margin of it."""
        return np.asarray(((points >= self.low - margin) & (points <= self.high + margin)).all(axis=1))


@dataclass(frozen=True, eq=False)
class Lattice:
    """Nodes at the centres of the voxels of an edge `resolution`, in cubic bricks of `cells` nodes an edge.

    Every node belongs to one brick. Coordinates in a local frame begin at `corner`, so that they are exact
    wherever in the world the lattice lies.

    Parameters
    ----------
    resolution : float
        Spacing of the nodes in metres.
    cells : int
        Nodes along each edge of a brick.
    origin : (3,) integer array
        The brick at the centre of the range of the keys, see `voxel_keys`.
    bricks : VoxelTable
        Row and key of each brick.
    """

    resolution: float
    cells: int
    origin: I64
    bricks: VoxelTable

    def __len__(self) -> int:
        return len(self.bricks)

    @property
    def corner(self) -> F64:
        """World position (3,) of the origin of the local frame: the first node of the brick `origin`."""
        return np.asarray((self.origin * self.cells + 0.5) * self.resolution)

    def first_nodes(self, part: slice) -> I64:
        """Return the first node (B, 3) of bricks, counted from the origin of the local frame."""
        return voxel_indices(self.bricks.keys[part], (0, 0, 0)) * self.cells

    def nodes(self, part: slice) -> F64:
        """Return the world positions (B * cells^3, 3) of the nodes of bricks."""
        steps = np.indices((self.cells,) * 3).reshape(3, -1).T
        index = self.first_nodes(part)[:, None] + steps + self.origin * self.cells
        return np.asarray((index.reshape(-1, 3) + 0.5) * self.resolution)

    def neighbours(self, part: slice) -> I64:
        """Return rows (B, 2, 2, 2) of bricks, and of those one further along some axes; -1 for none."""
        rows = np.empty((len(self.bricks.keys[part]), 2, 2, 2), dtype=np.int64)
        for x, y, z in product((0, 1), repeat=3):
            rows[:, x, y, z] = self.bricks.find(self.bricks.keys[part] + np.dot((x, y, z), STEP))
        return rows


def box_between(low: ArrayLike | None, high: ArrayLike | None) -> Box:
    """Return a box; a corner left out is no limit.

    Raises
    ------
    InputError
        Corners that are not three numbers each, or not in order.
    """
    a = np.full(3, -np.inf) if low is None else as_array("low", low, np.float64)
    b = np.full(3, np.inf) if high is None else as_array("high", high, np.float64)
    if a.shape != (3,) or b.shape != (3,) or not (a < b).all():
        raise InputError(
            f"a box needs two corners (3,), low below high along each axis, not {a.tolist()} and {b.tolist()}."
        )
    return Box(a, b)


def lattice_near(positions: F64, resolution: float, voxel: float, box: Box) -> Lattice:
    """Return the bricks with all nodes in a box and next to a surface within `REACH` voxels of positions (n, 3).

    Parameters
    ----------
    positions : (n, 3) array
        At least one.
    resolution : float
        Spacing of the nodes in metres.
    voxel : float
        The map's voxels, metres; those of the lattice count where they are larger.
    box : Box
        Where to look.

    Raises
    ------
    InputError
        More than `MOST_NODES` nodes.
    """
    lattice = _bricks_near(positions, resolution, voxel, box)
    if lattice is not None:
        return lattice
    fitting = max(resolution, 1e-3 * voxel)
    while _bricks_near(positions, fitting, voxel, box) is None:
        fitting *= 1.1
    raise InputError(
        f"a lattice of {resolution:g} m has more than {MOST_NODES:,} nodes near the surface: take a resolution of "
        f"{1.05 * fitting:.2g} m, or a smaller box (low, high)."
    )


def _bricks_near(positions: F64, resolution: float, voxel: float, box: Box) -> Lattice | None:
    """None where there are too many nodes."""
    edge = CELLS * resolution
    reach = REACH * max(voxel, resolution) + resolution  # a vertex lies between two nodes
    if 2 * reach / resolution > MOST_NODES ** (1 / 3):  # too many near a single position
        return None
    origin = voxel_origin(positions, edge)
    near = positions[box.holds(positions, reach)]
    bricks = VoxelTable()
    # Whatever meets the cube round a position holds one of these points, at most a brick apart from each other.
    for shift in product(np.linspace(-reach, reach, math.ceil(2 * reach / edge) + 1), repeat=3):
        bricks.insert(voxel_keys(near + shift, edge, origin))
        if len(bricks) > MOST_NODES // CELLS**3:
            return None
    keys = np.sort(bricks.keys)
    kept = VoxelTable()
    kept.insert(keys[box.holds(voxel_centres(keys, edge, origin), edge / 2)])
    return Lattice(resolution, CELLS, origin, kept)
