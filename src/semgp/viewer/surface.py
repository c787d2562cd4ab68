"""Where a viewer asks a map: points on the mapped surface, coarse or fine, never more than it can show."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from semgp.checks import require_finite
from semgp.errors import InputError
from semgp.maps.protocol import SemanticMap, SpatialMap
from semgp.picture.coverage import Discs, Planes, require_resolution, spacing_of, thinned

F64 = NDArray[np.float64]

_NEIGHBOURS = 32
"""Data, itself included, whose plane a normal belongs to."""
_SEERS = 12
"""Free places next to a datum, which tell the side from which it is seen."""
_WITNESSES = 256
"""Data that tell on which side of a wall the room lies, where no free space does."""
_BEYOND = 0.2
"""Share of the data that may lie behind a wall all the same."""


class Surface:
    """The surface that a map's data lie on.

    Coarser than the data, a point is the mean of a voxel's data. Finer, the data are covered with discs, as in
    pictures, and the points on these are thinned out.

    Parameters
    ----------
    positions : (n, 3) array
        Where the map has data, metres.
    free : (m, 3) array, optional
        Where the map knows that there is nothing: the sides from which the surface is seen.

    Raises
    ------
    InputError
        No data, or positions that are not finite.
    """

    def __init__(self, positions: F64, free: F64 | None = None) -> None:
        if not len(positions):
            raise InputError("the map is empty, there is nothing to see: build it from scans with labels.")
        require_finite("positions", positions)
        self.positions, self.free = positions, free

    @classmethod
    def of(cls, semantic_map: SemanticMap) -> Surface:
        """Return the surface of a map.

        Raises
        ------
        InputError
            An empty map.
        """
        return cls(semantic_map.positions, free_positions(semantic_map))

    @cached_property
    def low(self) -> F64:
        """Least coordinates (3,) of the data, metres."""
        return np.asarray(self.positions.min(axis=0))

    @cached_property
    def high(self) -> F64:
        """Greatest coordinates (3,) of the data, metres."""
        return np.asarray(self.positions.max(axis=0))

    @cached_property
    def spacing(self) -> float:
        """Usual distance in metres from a datum to those around it; of data in one place, their extent or 1 m."""
        return spacing_of(self.positions) or float((self.high - self.low).max()) or 1.0

    def points(self, resolution: float, most: int) -> tuple[F64, float]:
        """Return points on the surface, and how far apart they are.

        Parameters
        ----------
        resolution : float
            How far apart they are to be, metres; more where that would be too many.
        most : int
            The most points to return.

        Returns
        -------
        points : (M, 3) array
            Metres.
        resolution : float
            What was kept to.

        Raises
        ------
        InputError
            A resolution or number that is not positive.
        """
        require_resolution(resolution)
        if most < 1:
            raise InputError(f"a view needs room for at least one point, not {most}.")
        while True:
            finer = resolution < self.spacing
            if not finer or (self._discs.across(resolution).astype(float) ** 2).sum() <= 6 * most:
                points = thinned(self._discs.points(resolution) if finer else self.positions, resolution)
                if len(points) <= most:
                    return points, resolution
                resolution *= max(1.0, 0.8 * math.sqrt(len(points) / most))
            resolution *= 1.15

    def sides(self, points: F64) -> tuple[F64, NDArray[np.bool_]]:
        """Return where the surface faces at points on it, and whether it is seen from that side only.

        Where the map has free space, the surface faces it. Otherwise walls, floors and ceilings do: nearly all
        data lie on one side of them, which is the room's.

        Parameters
        ----------
        points : (M, 3) array
            Metres.

        Returns
        -------
        normals : (M, 3) array
            Of length one; zero where no plane fits: none fits the data of a line, such as a lidar's ring, or of a
            bush.
        one_sided : (M,) bool array
            False where the normal could as well point the other way.
        """
        nearest = cKDTree(self.positions).query(points)[1]
        normals, one_sided = self._sides
        return normals[nearest], one_sided[nearest]

    @cached_property
    def _planes(self) -> Planes:
        return Planes.through(self.positions, _NEIGHBOURS)

    @cached_property
    def _discs(self) -> Discs:
        return Discs.of(self.positions, self._planes, self.spacing)

    @cached_property
    def _sides(self) -> tuple[F64, NDArray[np.bool_]]:
        """Normals (n, 3) of the data, and whether they are seen from there only (n,)."""
        planes = self._planes
        flat = (planes.spread[:, 1] > 0.05 * planes.spread[:, 2]) & (
            planes.spread[:, 0] < 0.5 * planes.spread[:, 1]
        )
        normals = np.where(flat[:, None], planes.axes[:, 0], 0.0)
        if self.free is None:
            return self._facing_the_room(normals)
        around = self.free[cKDTree(self.free).query(self.positions, k=min(_SEERS, len(self.free)))[1]]
        outward = around.reshape(len(normals), -1, 3).mean(axis=1) - self.positions
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), np.finfo(float).tiny)
        away = (normals * outward).sum(axis=1, keepdims=True) < 0
        return np.where(flat[:, None], np.where(away, -normals, normals), outward), np.ones(
            len(normals), dtype=bool
        )

    def _facing_the_room(self, normals: F64) -> tuple[F64, NDArray[np.bool_]]:
        """Return normals turned to where most data lie, and whether hardly any lie on the other side."""
        witnesses = self.positions[:: -(-len(self.positions) // _WITNESSES)]
        before, behind = np.zeros((2, len(normals)), dtype=np.int64)
        level = (normals * self.positions).sum(axis=1)
        for witness in witnesses:
            height = normals @ witness - level
            before += height > 2 * self.spacing
            behind += height < -2 * self.spacing
        one_sided = np.minimum(before, behind) < _BEYOND * np.maximum(before, behind)
        return np.where((behind > before)[:, None], -normals, normals), one_sided


def free_positions(semantic_map: SemanticMap) -> F64 | None:
    """Return where a map knows that there is nothing, (m, 3), metres; None where it keeps no free space."""
    if not len(semantic_map.positions) or semantic_map.query(semantic_map.positions[:1]).occupancy is None:
        return None
    assert isinstance(semantic_map, SpatialMap)
    free = semantic_map.free_positions
    return free if len(free) else None
