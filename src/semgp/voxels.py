"""Voxels: points to integer keys, and a hash table from keys to rows."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from semgp.errors import InputError

AXIS_BITS = 21
"""Bits of a key for each axis: three axes fill the 63 value bits of an int64."""

HALF_RANGE = 1 << (AXIS_BITS - 1)
"""Keys reach this many voxels from the origin along each axis, either way."""

MARGIN = 1 << 10
"""Voxels at the rim of that range that no point may enter, so that neighbours' keys can be had by adding."""

STEP = (1 << 2 * AXIS_BITS, 1 << AXIS_BITS, 1)
"""Difference between the keys of two neighbours along x, y and z."""

OUTSIDE = -1
"""Key of a point beyond the range of the keys."""

EXACT = 2.0**52
"""Beyond this many voxels a float64 cannot tell one voxel from the next."""


def voxel_origin(points: NDArray[np.float64], resolution: float) -> NDArray[np.int64]:
    """Return the voxel (3,) of the first point: the origin of the keys of a map that begins with `points`.

    Raises
    ------
    InputError
        A resolution so fine, or a coordinate so large, that float64 cannot tell neighbouring voxels apart.
    """
    voxel = np.floor(points[0] / resolution)
    if not (np.abs(voxel) < EXACT).all():
        raise InputError(f"a point at {points[0]} m cannot be put into voxels of {resolution} m.")
    return np.asarray(voxel.astype(np.int64))


def voxel_keys(
    points: NDArray[np.float64],
    resolution: float,
    origin: ArrayLike = (0, 0, 0),
    *,
    allow_outside: bool = False,
) -> NDArray[np.int64]:
    """Return one integer for each point, the same for two points exactly when they share a voxel.

    Voxel v covers the coordinates from v * resolution (included) to (v + 1) * resolution (left out) of each
    axis. Its key is x * 2^42 + y * 2^21 + z, with x, y, z counted from `HALF_RANGE` voxels below the
    origin: a neighbour's key differs by a constant (`STEP`), and sorted keys go through space slab by slab.
    With an origin near the data, keys are exact for UTM coordinates at 1 cm and finer.

    Parameters
    ----------
    points : (N, 3) array
        Positions in metres.
    resolution : float
        Edge of a voxel in metres.
    origin : (3,) integer array, optional
        The voxel at the centre of the range of the keys, see `voxel_origin`.
    allow_outside : bool, optional
        Give points beyond the range the key `OUTSIDE`, which no voxel has, instead of raising.

    Raises
    ------
    InputError
        A point beyond the range of the keys: a million voxels from the origin along an axis.
    """
    keys = np.empty(len(points), dtype=np.int64)
    reach = HALF_RANGE if allow_outside else HALF_RANGE - MARGIN
    outside = _fill_keys(points, resolution, np.asarray(origin, dtype=np.float64), reach, keys)
    if outside >= 0 and not allow_outside:
        raise InputError(
            f"the point at {points[outside]} m is more than {reach * resolution:g} m away from where the map "
            f"of {resolution:g} m voxels began: drop stray points, take larger voxels, or begin another map."
        )
    return keys


def voxel_indices(keys: NDArray[np.int64], origin: ArrayLike) -> NDArray[np.int64]:
    """Return the voxels (V, 3), counted from the world's origin, that have these keys."""
    mask = (1 << AXIS_BITS) - 1
    index = np.stack([keys >> 2 * AXIS_BITS, keys >> AXIS_BITS & mask, keys & mask], axis=1)
    return np.asarray(index - HALF_RANGE + np.asarray(origin))


def voxel_centres(keys: NDArray[np.int64], resolution: float, origin: ArrayLike) -> NDArray[np.float64]:
    """Return the centres (V, 3), in metres, of the voxels that have these keys."""
    return np.asarray((voxel_indices(keys, origin) + 0.5) * resolution)


class VoxelTable:
    """Rows 0, 1, 2 ... for voxel keys, given in order of first appearance.

    A hash table with linear probing, at most half full.
    """

    def __init__(self) -> None:
        self._n = 0
        self._keys = np.empty(0, dtype=np.int64)
        self._slots = hash_slots(self._keys, 0, 0)

    def __len__(self) -> int:
        return self._n

    @property
    def keys(self) -> NDArray[np.int64]:
        """Key (V,) of each row."""
        return self._keys[: self._n]

    @property
    def slots(self) -> NDArray[np.int64]:
        """The hash table, for compiled code: see `slot_of`."""
        return self._slots

    @property
    def n_bytes(self) -> int:
        """Bytes of keys and hash table."""
        return self._keys.nbytes + self._slots.nbytes

    def insert(self, keys: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row (N,) of each key; keys not met before get new rows."""
        needed = self._n + len(keys)
        if needed > len(self._keys):
            buffer = np.empty(max(needed, 2 * self._n), dtype=np.int64)
            buffer[: self._n] = self.keys
            self._keys, self._slots = buffer, hash_slots(buffer, self._n, len(buffer))
        rows = np.empty(len(keys), dtype=np.int64)
        self._n = _insert(keys, self._slots, self._keys, self._n, rows)
        return rows

    def find(self, keys: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row (N,) of each key, -1 for keys that have none."""
        rows = np.empty(len(keys), dtype=np.int64)
        _find(keys, self._slots, self._keys, rows)
        return rows


@njit(cache=True, nogil=True)
def slot_of(key: int | np.int64, slots: NDArray[np.int64], keys: NDArray[np.int64]) -> np.int64:
    """Return the slot that holds the row of `key`, or the empty one (-1) where it belongs."""
    mask = len(slots) - 1
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)  # Fibonacci hashing: the high bits are well mixed
    slot = np.int64(mixed >> np.uint64(32)) & mask
    while slots[slot] >= 0 and keys[slots[slot]] != key:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, nogil=True)
def hash_slots(keys: NDArray[np.int64], n: int, capacity: int) -> NDArray[np.int64]:
    """Return the slots of a table of the first `n` keys with room for `capacity` of them."""
    size = 2
    while size < 2 * capacity:
        size *= 2
    slots = np.full(size, -1, dtype=np.int64)
    for row in range(n):
        slots[slot_of(keys[row], slots, keys)] = row
    return slots


@njit(cache=True, nogil=True)
def _insert(
    new: NDArray[np.int64],
    slots: NDArray[np.int64],
    keys: NDArray[np.int64],
    n: int,
    rows: NDArray[np.int64],
) -> int:
    for i in range(len(new)):
        slot = slot_of(new[i], slots, keys)
        if slots[slot] < 0:
            slots[slot] = n
            keys[n] = new[i]
            n += 1
        rows[i] = slots[slot]
    return n


@njit(cache=True, nogil=True)
def _find(
    wanted: NDArray[np.int64], slots: NDArray[np.int64], keys: NDArray[np.int64], rows: NDArray[np.int64]
) -> None:
    for i in range(len(wanted)):
        rows[i] = slots[slot_of(wanted[i], slots, keys)]


@njit(cache=True, nogil=True)
def _fill_keys(
    points: NDArray[np.float64],
    resolution: float,
    origin: NDArray[np.float64],
    reach: int,
    keys: NDArray[np.int64],
) -> int:
    """Fill in the keys and return the last point outside, -1 if there is none."""
    outside = -1
    for i in range(len(points)):
        x = math.floor(points[i, 0] / resolution) - origin[0]
        y = math.floor(points[i, 1] / resolution) - origin[1]
        z = math.floor(points[i, 2] / resolution) - origin[2]
        if -reach <= x < reach and -reach <= y < reach and -reach <= z < reach:
            high = (np.int64(x) + HALF_RANGE) << (2 * AXIS_BITS)
            keys[i] = high + ((np.int64(y) + HALF_RANGE) << AXIS_BITS) + np.int64(z) + HALF_RANGE
        else:
            keys[i] = OUTSIDE
            outside = i
    return outside
