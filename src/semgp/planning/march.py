"""Marching along rays to the first surface: only where surfaces may be, front to back, in few large batches."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgp.maps.protocol import BATCH, SpatialMap
from semgp.parallel import slices
from semgp.planning.asking import occupancy_at, samples_along
from semgp.planning.shell import Shell, next_samples, shell_around

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

_STEPS_A_VOXEL = 2  # steps along a ray for each voxel of the map
_HALVINGS = 3  # of the step in which a ray meets a surface
_FIRST_LOOK = 8  # samples of a ray asked first, then twice as many each time
_RAYS_AT_ONCE = 1 << 15


class Rays(NamedTuple):
    """Rays with origins (R, 3) and unit directions (R, 3), all of one length in metres."""

    origins: F64
    directions: F64
    length: float

    def points(self, ray: I64, t: F64) -> F64:
        """Return the points (M, 3) at distances (M,) along rays (M,)."""
        return np.asarray(self.origins[ray] + t[:, None] * self.directions[ray])


def first_surfaces(semantic_map: SpatialMap, rays: Rays, threshold: float) -> F64:
    """Return how far each ray goes (R,) until it meets what is occupied with this probability; else infinity."""
    step = semantic_map.resolution / _STEPS_A_VOXEL
    n_steps = samples_along(rays.length, step)
    distance = np.full(len(rays.origins), np.inf)
    shell = _shell(semantic_map, rays)
    if shell is not None:
        for part in slices(len(distance), _RAYS_AT_ONCE):
            some = Rays(rays.origins[part], rays.directions[part], rays.length)
            distance[part] = _march(semantic_map, some, step, n_steps, threshold, shell)
    return distance


def _shell(semantic_map: SpatialMap, rays: Rays) -> Shell | None:
    """Return the shell of what lies within a voxel of places where the sensor's rays ended, if any is in reach."""
    positions, reach = semantic_map.occupied_positions, semantic_map.resolution
    ends = rays.origins + rays.length * rays.directions
    low = np.minimum(rays.origins, ends).min(axis=0) - reach
    high = np.maximum(rays.origins, ends).max(axis=0) + reach
    near = positions[((positions >= low) & (positions <= high)).all(axis=1)]
    return shell_around(near, reach) if len(near) else None


def _march(semantic_map: SpatialMap, rays: Rays, step: float, n_steps: int, threshold: float, shell: Shell) -> F64:
    """Return the distances (R,); rays that have met something drop out."""
    first = np.full(len(rays.origins), -1)  # the first sample of each ray that lies in something
    ray, following, wanted = np.arange(len(first)), np.zeros(len(first), dtype=np.int64), _FIRST_LOOK
    while len(ray):
        sample = next_samples(rays.origins[ray], rays.directions[ray], n_steps, step, shell, following, wanted)
        row, column = np.nonzero(sample >= 0)
        t = np.minimum(sample[row, column] * step, rays.length)
        inside = np.zeros(sample.shape, dtype=bool)
        inside[row, column] = _is_surface(semantic_map, rays.points(ray[row], t), threshold)
        met = inside.any(axis=1)
        first[ray[met]] = sample[met, inside[met].argmax(axis=1)]
        going = ~met & (sample[:, -1] >= 0)
        ray, following = ray[going], following[going]
        wanted = max(_FIRST_LOOK, min(2 * wanted, BATCH // max(1, len(ray))))
    ray = np.flatnonzero(first >= 0)
    distance = np.full(len(first), np.inf)
    before, after = np.maximum(first[ray] - 1, 0) * step, np.minimum(first[ray] * step, rays.length)
    for _ in range(_HALVINGS):
        middle = (before + after) / 2
        beyond = _is_surface(semantic_map, rays.points(ray, middle), threshold)
        before, after = np.where(beyond, before, middle), np.where(beyond, middle, after)
    distance[ray] = after
    return distance


def _is_surface(semantic_map: SpatialMap, points: F64, threshold: float) -> Bool:
    occupancy = occupancy_at(semantic_map, points)
    return np.asarray(occupancy.known & (occupancy.probability >= threshold))
