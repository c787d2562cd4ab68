"""Occupancy as OctoMap keeps it: which voxels are free, occupied or unknown."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.errors import InputError
from semgp.maps.protocol import query_points
from semgp.maps.settings import require_positive
from semgp.octomap.bricks import Bricks
from semgp.octomap.cells import Cells, Occupancy
from semgp.octomap.morton import DEPTH, HALF, OUTSIDE, cell_centres, voxel_codes
from semgp.octomap.rays import cast_discretized, cast_rays, sight_ends
from semgp.octomap.sensor import SensorModel
from semgp.octomap.tree import Leaves, greatest_within, prune, unknown_leaves


class OccupancyMap:
    """Log-odds of occupancy in voxels, updated by casting rays.

    Parameters
    ----------
    resolution : float
        Edge of a voxel in metres.
    sensor : SensorModel, optional
        How much a ray tells.
    max_range : float, optional
        A longer ray is cut to this length: it makes voxels free, and its point is left out. None for no limit.
    discretize : bool, optional
        Cast one ray to the centre of each voxel that holds points, not one to each point: faster, and a little
        different (`insertPointCloud(..., discretize=True)`).
    origin : (3,) array, optional
        Where the map's own coordinates begin, in metres, rounded down to whole voxels. The map reaches 32,768
        voxels from there along each axis, either way, and computes in float32, like OctoMap: for UTM
        coordinates, take a point near the data.

    Raises
    ------
    InputError
        A resolution or range that is not positive, or an origin that is not three finite numbers.

    References
    ----------
    Hornung, Wurm, Bennewitz, Stachniss and Burgard (2013), "OctoMap: an efficient probabilistic 3D mapping
    framework based on octrees", Autonomous Robots 34.
    """

    def __init__(
        self,
        resolution: float,
        *,
        sensor: SensorModel | None = None,
        max_range: float | None = None,
        discretize: bool = False,
        origin: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        self.resolution = require_positive("resolution", resolution)
        self.sensor = sensor or SensorModel()
        self.max_range = None if max_range is None else require_positive("max_range", max_range)
        self.discretize = bool(discretize)
        self.origin = np.floor(_position("origin", origin) / self.resolution) * self.resolution
        self._bricks = Bricks()

    def __len__(self) -> int:
        """Return the number of known voxels."""
        return self._bricks.n_voxels

    def insert(
        self, points: NDArray[np.float64], sensor_position: NDArray[np.float64] | None
    ) -> NDArray[np.int64]:
        """Update each voxel that rays from a sensor (3,) to points (N, 3) pass or reach, once.

        `insertPointCloud`. Without a sensor position there are no rays: the points' voxels are hit, and none
        is passed.

        Returns
        -------
        codes : (N,) array
            The voxel that each point hit; `OUTSIDE` for points beyond the range.

        Raises
        ------
        InputError
            Points or a sensor beyond the reach of the map; the map is then as before.
        """
        if len(points) == 0:
            return np.empty(0, dtype=np.int64)
        ends = self._local(points)
        codes = self._codes_inside("point", points, ends)
        if sensor_position is None:
            seen = sight_ends(codes)
        else:
            start = self._local(sensor_position[None])
            self._codes_inside("sensor", sensor_position[None], start)
            max_range = self.max_range or math.inf
            if self.discretize:
                seen, reached = cast_discretized(codes, start[0], self.resolution, max_range)
            else:
                seen, reached = cast_rays(ends, codes, start[0], self.resolution, max_range)
            codes[~reached] = OUTSIDE
        self._bricks.integrate(seen, self.sensor)
        return codes

    def query_occupancy(self, points: ArrayLike, depth: int | None = None) -> Occupancy:
        """Return what is known at points (M, 3), metres, world frame.

        Parameters
        ----------
        points : (M, 3) array
            Where to look; a point is rounded to float32 first, so that a point of an inserted cloud is found in
            the voxel that it was put into. Points beyond the reach of the map are unknown.
        depth : int, optional
            Depth of the cells to look at, from 0, the root, to 16, the voxels. A cell is known if any of its
            voxels is, and has their greatest log-odds.

        Raises
        ------
        InputError
            Points that are not (M, 3) and finite, or a depth that the tree has not.
        """
        depth = DEPTH if depth is None else depth
        if depth not in range(DEPTH + 1):
            raise InputError(f"the depth of a cell is a whole number from 0 to {DEPTH}, not {depth!r}.")
        codes = self._codes(query_points(points))
        if depth == DEPTH:
            values, known = self._bricks.find(codes)
        else:
            values, known = greatest_within(self._leaves(), codes, depth)
            known &= codes != OUTSIDE
            values[~known] = 0
        return Occupancy(values, known, known & self.sensor.occupied(values))

    def leaves(self, *, pruned: bool = True) -> Cells:
        """Return the known cells: the leaves of the pruned tree, or each voxel by itself."""
        return self._cells(self._leaves() if pruned else self._voxels())

    def occupied(self, *, pruned: bool = True) -> Cells:
        """Return the occupied cells."""
        cells = self.leaves(pruned=pruned)
        return cells[self.sensor.occupied(cells.log_odds)]

    def free(self, *, pruned: bool = True) -> Cells:
        """Return the free cells."""
        cells = self.leaves(pruned=pruned)
        return cells[~self.sensor.occupied(cells.log_odds)]

    def unknown(self, lower: ArrayLike | None = None, upper: ArrayLike | None = None) -> Cells:
        """Return the unknown cells that reach into a box, the largest that there are.

        Parameters
        ----------
        lower, upper : (3,) arrays, optional
            Corners of the box in metres, world frame; left out, all space that the map can reach.

        Raises
        ------
        InputError
            Corners that are not three finite numbers.
        """
        cells = self._cells(unknown_leaves(self._leaves()))
        low = -np.inf if lower is None else _position("lower", lower)
        high = np.inf if upper is None else _position("upper", upper)
        half = cells.sizes[:, None] / 2
        inside = (cells.centres + half > low) & (cells.centres - half < high)
        return cells[np.asarray(inside.all(axis=1))]

    def prune(self) -> None:
        """Give spare memory back.

        Cells whose voxels are alike are kept as one at all times, as in OctoMap since its version 1.7, so
        this changes no answer.
        """
        self._bricks.trim()

    def _leaves(self) -> Leaves:
        return prune(self._bricks.voxels(of_solid=False), self._bricks.solid())

    def _voxels(self) -> Leaves:
        codes, values = self._bricks.voxels()
        return Leaves(codes, np.full(len(codes), DEPTH), values)

    def _cells(self, leaves: Leaves) -> Cells:
        sizes = self.resolution * np.left_shift(1, DEPTH - leaves.depth)
        centres = cell_centres(leaves.first, leaves.depth, self.resolution) + self.origin
        return Cells(centres, sizes, leaves.state.astype(np.float32))

    def _local(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        with np.errstate(over="ignore"):  # what becomes infinite is beyond the map
            return (points - self.origin).astype(np.float32)

    def _codes(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        return voxel_codes(self._local(points), self.resolution)

    def _codes_inside(
        self, name: str, points: NDArray[np.float64], local: NDArray[np.float32]
    ) -> NDArray[np.int64]:
        codes = voxel_codes(local, self.resolution)
        outside = codes == OUTSIDE
        if outside.any():
            raise InputError(
                f"the {name} at {points[np.argmax(outside)]} m is beyond the map, which reaches "
                f"{HALF * self.resolution:g} m from its origin {self.origin} along each axis: give the map an "
                "origin near the data, or a coarser resolution."
            )
        return codes


def _position(name: str, value: ArrayLike) -> NDArray[np.float64]:
    position = np.asarray(value, dtype=np.float64)
    if position.shape != (3,) or not np.isfinite(position).all():
        raise InputError(f"{name} must be three finite numbers, not {value!r}.")
    return position
