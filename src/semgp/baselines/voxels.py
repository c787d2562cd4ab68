"""What the voxel baselines share: class mass summed in a sparse grid of voxels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.maps.settings import stored_array
from semgp.parallel import parallel_map, slices
from semgp.voxels import VoxelTable, voxel_centres, voxel_keys, voxel_origin

_CHUNK = 65_536  # query points that one thread answers at a time


class VoxelMass:
    """Class mass (V, C) of the voxels met so far.

    Parameters
    ----------
    n_classes : int
        Number of classes C.
    resolution : float
        Edge of a voxel in metres.
    """

    def __init__(self, n_classes: int, resolution: float) -> None:
        self.resolution = resolution
        self.origin = np.zeros(3, dtype=np.int64)
        self._table = VoxelTable()
        self._mass = np.zeros((0, n_classes), dtype=np.float32)

    def __len__(self) -> int:
        return len(self._table)

    @property
    def n_bytes(self) -> int:
        """Bytes that keys and mass take, the hash table's slots left out."""
        return len(self) * (8 + 4 * self._mass.shape[1])

    @property
    def centres(self) -> NDArray[np.float64]:
        """Centres (V, 3) of the voxels, metres."""
        return voxel_centres(self._table.keys, self.resolution, self.origin)

    def keys(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the voxel keys (N,) of points; the first point of all settles the origin of the keys.

        Raises
        ------
        InputError
            A point a million voxels away from the first.
        """
        first = len(self) == 0 and len(points) > 0
        origin = voxel_origin(points, self.resolution) if first else self.origin
        keys = voxel_keys(points, self.resolution, origin)
        self.origin = origin
        return keys

    def add(self, keys: NDArray[np.int64], mass: NDArray[np.float32]) -> None:
        """Add class mass (N, C) to the voxels with these keys, which may repeat."""
        rows = self._table.insert(keys)
        if len(self) > len(self._mass):
            grown = np.zeros((max(len(self), 2 * len(self._mass)), self._mass.shape[1]), dtype=np.float32)
            grown[: len(self._mass)] = self._mass
            self._mass = grown
        _add_rows(self._mass, rows, mass)

    def at(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the class mass (M, C) of the voxels in which the points lie, zero where there is none."""
        mass = np.zeros((len(points), self._mass.shape[1]), dtype=np.float32)

        def fill(part: slice) -> None:
            keys = voxel_keys(points[part], self.resolution, self.origin, allow_outside=True)
            _copy_rows(self._mass, self._table.find(keys), mass[part])

        parallel_map(fill, slices(len(points), _CHUNK))
        return mass

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return keys (V,), their origin (3,) and mass (V, C)."""
        return {"keys": self._table.keys, "origin": self.origin, "mass": self._mass[: len(self)]}

    @classmethod
    def from_arrays(cls, n_classes: int, resolution: float, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Make the voxels again from what `to_arrays` gave.

        Raises
        ------
        InputError
            Arrays that are missing, of another shape or type, or hold impossible values.
        """
        voxels = cls(n_classes, resolution)
        keys = stored_array(arrays, "keys", np.int64, (None,))
        mass = stored_array(arrays, "mass", np.float32, (len(keys), n_classes))
        if not (np.isfinite(mass) & (mass >= 0)).all() or (len(keys) and keys.min() < 0):
            raise InputError("the stored voxels are damaged: keys and mass must be finite and not negative.")
        voxels.origin = stored_array(arrays, "origin", np.int64, (3,))
        voxels.add(keys, mass)
        if len(voxels) != len(keys):
            raise InputError("the stored voxels are damaged: a key occurs more than once.")
        return voxels


@njit(cache=True, nogil=True)
def _add_rows(total: NDArray[np.float32], rows: NDArray[np.int64], mass: NDArray[np.float32]) -> None:
    for i in range(len(rows)):
        for c in range(total.shape[1]):
            total[rows[i], c] += mass[i, c]


@njit(cache=True, nogil=True)
def _copy_rows(total: NDArray[np.float32], rows: NDArray[np.int64], out: NDArray[np.float32]) -> None:
    for i in range(len(rows)):
        if rows[i] >= 0:
            for c in range(total.shape[1]):
                out[i, c] = total[rows[i], c]
