"""Where rays have passed: samples of free space between a sensor and the points of a scan."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from semgp.blocks.arrays import F64, I64, Bool
from semgp.blocks.growing import longer, longer_rows
from semgp.parallel import n_workers, parallel_map, slices
from semgp.voxels import AXIS_BITS, HALF_RANGE, STEP, VoxelTable, slot_of

_HASH = np.uint64(0x9E3779B97F4A7C15)


class Walk(NamedTuple):
    """How rays are walked; lengths in metres.

    resolution: edge of a voxel, and the step along a ray. origin (3,): voxel at the origin of the keys. share: of
    the rays, drawn by a hash with the seed. margin: how far before its end a ray is last sampled. near: within
    this length of its end every sample counts. thin: farther out only those in one voxel in so many count, in the
    same ones for every ray. reach: rays are cut at this length.
    """

    resolution: float
    origin: F64
    share: float
    seed: int
    margin: float
    near: float
    thin: int
    reach: float


def free_samples(sensor: F64, points: F64, walk: Walk, voxels: VoxelTable, watched: Bool) -> tuple[F64, I64, Bool]:
    """Return samples (n, 3) along the rays from a sensor (3,) to points, in metres, and their voxels' keys (n,).

    Samples in `watched` rows of a table of voxels, a mask that may be empty, count wherever they are. The last
    array, as long as that mask, tells which of them some ray has passed.
    """

    def run(part: slice) -> tuple[F64, I64, Bool]:
        return _walk(sensor, points[part], walk, voxels.slots, voxels.keys, watched)

    size = max(1, -(-len(points) // n_workers()))
    samples, keys, passed = zip(*parallel_map(run, slices(len(points), size)))
    return np.concatenate(samples), np.concatenate(keys), np.logical_or.reduce(passed)


@njit(cache=True, nogil=True)
def _walk(sensor: F64, points: F64, walk: Walk, slots: I64, known: I64, watched: Bool) -> tuple[F64, I64, Bool]:
    step = walk.resolution
    samples, keys = np.empty((1 << 14, 3)), np.empty(1 << 14, np.int64)
    passed = np.zeros(len(watched), np.bool_)
    most = np.uint64(min(walk.share, 1.0) * 2.0**32)
    d = np.empty(3)
    n = 0
    for i in range(len(points)):
        for k in range(3):
            d[k] = points[i, k] - sensor[k]
        drawn = _mixed(d, walk.seed)
        length = np.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
        if (drawn >> np.uint64(32)) >= most or length < step:
            continue
        for k in range(3):
            d[k] /= length
        phase = float(np.int64(drawn & np.uint64(0xFFFF))) / 65536.0
        begin = min(length - walk.margin, walk.reach) - phase * step
        count = int(np.floor(begin / step))
        if n + count > len(keys):
            samples, keys = longer_rows(samples, 2 * (n + count)), longer(keys, 2 * (n + count))
        near = int(np.ceil((begin - (length - walk.near)) / step))
        n = _along(sensor, d, begin, count, near, walk, slots, known, watched, passed, samples, keys, n)
    return samples[:n], keys[:n], passed


@njit(cache=True, nogil=True)
def _along(
    sensor: F64, d: F64, begin: float, count: int, near: int, walk: Walk,
    slots: I64, known: I64, watched: Bool, passed: Bool, samples: F64, keys: I64, n: int,
) -> int:  # fmt: skip
    """Step from `begin`, metres from the sensor, towards it; the first `near` samples count wherever they are."""
    most = np.uint64(2.0**24 / walk.thin)
    # places in voxels, with 32 bits after the point: a step is three additions
    x = _placed((sensor[0] + begin * d[0]) / walk.resolution, walk.origin[0])
    y = _placed((sensor[1] + begin * d[1]) / walk.resolution, walk.origin[1])
    z = _placed((sensor[2] + begin * d[2]) / walk.resolution, walk.origin[2])
    # what makes keys those of the world's voxels: which of them count does not depend on where the map began
    world = np.int64(walk.origin[0]) * STEP[0] + np.int64(walk.origin[1]) * STEP[1] + np.int64(walk.origin[2])
    step_x, step_y, step_z = _fixed(d[0]), _fixed(d[1]), _fixed(d[2])
    for k in range(count):
        key = ((x >> 32) << (2 * AXIS_BITS)) | ((y >> 32) << AXIS_BITS) | (z >> 32)
        matters = k < near or (np.uint64(key + world) * _HASH) >> np.uint64(40) < most
        if len(watched):
            row = slots[slot_of(key, slots, known)]
            if row >= 0 and watched[row]:
                passed[row] = matters = True
        if matters:
            t = begin - k * walk.resolution
            key = np.int64(0)
            for axis in range(3):
                place = sensor[axis] + t * d[axis]
                samples[n, axis] = place
                voxel = np.int64(np.floor(place / walk.resolution) - walk.origin[axis]) + HALF_RANGE
                key = (key << AXIS_BITS) | voxel  # rounded as those of points are
            keys[n] = key
            n += 1
        x, y, z = x - step_x, y - step_y, z - step_z
    return n


@njit(cache=True, nogil=True, inline="always")
def _fixed(v: float) -> np.int64:
    return np.int64(np.rint(v * 4294967296.0))


@njit(cache=True, nogil=True, inline="always")
def _placed(v: float, origin: float) -> np.int64:
    """A place in voxels, rounded down before the origin is taken off, as `semgp.voxels.voxel_keys` does."""
    voxel = np.floor(v)
    within = min(_fixed(v - voxel), np.int64((1 << 32) - 1))
    return (np.int64(voxel - origin) + HALF_RANGE) * np.int64(1 << 32) + within


@njit(cache=True, nogil=True, inline="always")
def _mixed(d: F64, seed: int) -> np.uint64:
    """A hash of a ray to the tenth of a millimetre: the draw does not depend on the order of points."""
    h = np.uint64(seed) * _HASH
    for k in range(3):
        h = (h ^ np.uint64(np.int64(np.rint(d[k] * 1e4)) & 0x7FFFFFFFFFFFFFFF)) * _HASH
        h ^= h >> np.uint64(29)
    return h * _HASH
