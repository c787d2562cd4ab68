"""Ray casting: the first surface that each ray is likely to meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.checks import as_array, require_finite
from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.maps.protocol import BATCH, SpatialMap, occupancy_of
from semgp.maps.settings import require_positive
from semgp.parallel import slices
from semgp.planning.asking import answers, occupancy_at, require_occupancy, samples_along, unit_directions
from semgp.planning.march import Rays, first_surfaces

F64 = NDArray[np.float64]

_UNKNOWN_PIECE = 2  # voxels of the map: the pieces of a ray that are unknown or not as a whole


@dataclass(frozen=True, eq=False)
class RayHits:
    """What R rays meet first.

    Parameters
    ----------
    distance : (R,) array
        Metres from the origin to the surface; infinite where there is none within range.
    points : (R, 3) array
        Where it is met, metres, world frame; NaN where there is none.
    probability : (R,) array
        Probability that something is there; NaN where nothing is met.
    label : (R,) int32 array
        Most probable class there; `MISSING` where nothing is met, or where the map has no label for it.
    class_probability : (R, C) array
        Class probabilities there; NaN where nothing is met.
    through_unknown : (R,) array, optional
        Metres of unknown space that the ray passes before the surface, or before the end of its range. None where
        not asked for.
    """

    distance: F64
    points: F64
    probability: F64
    label: NDArray[np.int32]
    class_probability: F64
    through_unknown: F64 | None = None

    def __len__(self) -> int:
        return len(self.distance)

    @property
    def met(self) -> NDArray[np.bool_]:
        """True (R,) where a surface is met."""
        return np.isfinite(self.distance)


def raycast(
    semantic_map: SpatialMap,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    max_range: float,
    threshold: float = 0.5,
    through_unknown: bool = False,
) -> RayHits:
    """Return the first surface that each ray is likely to meet.

    A surface begins where a place that is known is occupied with a probability of `threshold` or more; a ray that
    begins inside of something meets it at once. Surfaces are looked for near the places where the sensor's rays
    ended, up to a voxel of the map away along each axis. There rays are sampled twice a voxel, and the step in
    which a surface begins is halved three times. So distances are the map's to a sixteenth of a voxel. What may be
    missed are corners that a ray cuts off by less than half a voxel, and what the map takes for occupied where no
    data are.

    Parameters
    ----------
    semantic_map : SpatialMap
        A map that keeps free space.
    origins : (R, 3) or (3,) array
        Where the rays begin, metres, world frame.
    directions : (R, 3) array
        Their directions, of any length but zero.
    max_range : float
        Their length in metres.
    threshold : float, optional
        Between 0 and 1.
    through_unknown : bool, optional
        Find out how much unknown space the rays pass. The map is asked every two voxels all along them, which can
        take longer than the rest.

    Raises
    ------
    InputError
        Arrays of other shapes or not finite, directions of length zero, a range that is not positive or has more
        than a million steps of half a voxel, a threshold not between 0 and 1, or a map that keeps no free space.
    """
    d = unit_directions(directions)
    rays = Rays(_origins(origins, len(d)), d, require_positive("max_range", max_range))
    if not 0 < threshold < 1:
        raise InputError(f"the threshold must lie between 0 and 1, not at {threshold}.")
    if not len(d):
        return _described(semantic_map, rays, np.empty(0), np.empty(0) if through_unknown else None)
    require_occupancy(semantic_map, rays.origins[0])
    distance = first_surfaces(semantic_map, rays, threshold)
    passed = _unknown_until(semantic_map, rays, distance) if through_unknown else None
    return _described(semantic_map, rays, distance, passed)


def _origins(origins: ArrayLike, n: int) -> F64:
    o = as_array("origins", origins, np.float64)
    if o.shape not in ((3,), (n, 3)):
        raise InputError(f"origins must have shape (3,) or ({n}, 3) to go with {n} directions, not {o.shape}.")
    o = np.ascontiguousarray(np.broadcast_to(o, (n, 3)))
    require_finite("origins", o)
    return o


def _unknown_until(semantic_map: SpatialMap, rays: Rays, distance: F64) -> F64:
    """Return how many metres (R,) of rays are unknown up to a distance (R,): pieces count whose middles are."""
    piece = _UNKNOWN_PIECE * semantic_map.resolution
    begin = np.arange(samples_along(rays.length, piece)) * piece
    unknown = np.zeros(len(distance))
    for part in slices(len(distance), max(1, BATCH // len(begin))):
        length = np.clip(np.minimum(distance[part, None], rays.length) - begin, 0, piece)
        row, column = np.nonzero(length)
        length = length[row, column]
        known = occupancy_at(semantic_map, rays.points(part.start + row, begin[column] + length / 2)).known
        unknown[part] = np.bincount(row, length * ~known, part.stop - part.start)
    return unknown


def _described(semantic_map: SpatialMap, rays: Rays, distance: F64, through_unknown: F64 | None) -> RayHits:
    """Ask what is there where rays meet something."""
    n, met = len(distance), np.flatnonzero(np.isfinite(distance))
    hits = RayHits(
        distance,
        np.full((n, 3), np.nan),
        np.full(n, np.nan),
        np.full(n, MISSING, dtype=np.int32),
        np.full((n, len(semantic_map.classes)), np.nan),
        through_unknown,
    )
    hits.points[met] = rays.points(met, distance[met])
    for part, prediction in answers(semantic_map, hits.points[met]):
        hits.probability[met[part]] = occupancy_of(prediction).probability
        hits.label[met[part]] = prediction.label
        hits.class_probability[met[part]] = prediction.probability
    return hits
