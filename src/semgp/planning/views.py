"""Information gain: what the next scan from a pose would tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.checks import as_array, rigid_transform
from semgp.errors import InputError
from semgp.maps.protocol import SpatialMap, occupancy_of
from semgp.maps.settings import require_positive
from semgp.parallel import slices
from semgp.planning.asking import answers, require_occupancy, samples_along, unit_directions
from semgp.planning.channels import class_information, occupancy_information, require_errors
from semgp.voxels import VoxelTable, voxel_centres, voxel_keys, voxel_origin

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

HARDLY = 1e-3
"""What a ray reaches with a smaller probability than this does not count."""

MOST_SAMPLES = 1 << 24
"""A view of more samples than these 16,777,216, rays times samples a ray, is refused: it would fill the memory."""

_SAMPLES_AT_ONCE = 1 << 22
_STAGE = 16  # samples of a ray asked before it is seen whether it goes on


@dataclass(frozen=True, eq=False)
class InformationGain:
    """Mutual information, in nats, between the map and the next scan from each of V poses.

    Parameters
    ----------
    occupancy : (V,) array
        Of what the scan tells of where something is.
    classes : (V,) array
        Of what it tells of the classes of what is there.
    """

    occupancy: F64
    classes: F64

    def __len__(self) -> int:
        return len(self.occupancy)

    @property
    def total(self) -> F64:
        """Both together (V,)."""
        return self.occupancy + self.classes


def information_gain(
    semantic_map: SpatialMap,
    poses: ArrayLike,
    directions: ArrayLike,
    *,
    max_range: float,
    spacing: float | None = None,
    sensor_error: float = 0.05,
    label_error: float = 0.2,
) -> InformationGain:
    """Return how much a scan from each pose is expected to tell.

    A ray meets voxels 1, 2 ... of occupancies p_1, p_2 ... (the map's guess where unknown), and reaches the j-th
    with probability r_j = (1 - p_1) ... (1 - p_{j-1}). Of free or occupied it tells there what a binary symmetric
    channel of error e does, I_o = H(p (1 - e) + (1 - p) e) - H(e); and of the class, if something is there, what a
    C-ary symmetric channel of error e_c does, I_c = H(q) - H(1 - e_c, e_c / (C - 1), ...), where q is how likely
    the sensor gives each label. The gain is the sum of r_j (I_o + p_j I_c) over all voxels, each with its greatest
    r_j among the rays of the view.

    This is an approximation: voxels are independent given the map, a ray tells of each voxel that it reaches by
    itself, rays without a return tell nothing of what lies beyond the range, and several looks at a voxel tell no
    more than one. The beams are those of Julian, Karaman and Rus (2014), "On mutual information-based control of
    range sensing robots for mapping applications", IJRR 33; the classes are added after Asgharivaskasi and
    Atanasov (2023), "Semantic octree mapping and Shannon mutual information computation for robot exploration",
    T-RO 39. A map that never gets sure of what is free keeps gaining from it: explore with an OctoMap whose sensor
    model has a `clamp_min` well below the default of 0.12.

    Parameters
    ----------
    semantic_map : SpatialMap
        A map that keeps free space; asked once at the centre of each voxel that rays reach.
    poses : (V, 4, 4) array
        Poses `T_world_sensor`.
    directions : (K, 3) array
        The sensor's rays, in its own frame, of any length but zero.
    max_range : float
        Range of the sensor in metres.
    spacing : float, optional
        Edge of the voxels, and step along the rays, in metres; left out, the map's resolution. The number of
        voxels, and with it the gain, depends on it: compare only what was computed with the same.
    sensor_error : float, optional
        e: how often the sensor takes free for occupied or the other way round; 0 to 1/2.
    label_error : float, optional
        e_c: how often a label is wrong; 0 to (C - 1) / C.

    Raises
    ------
    InputError
        Poses that are no rigid transforms, directions not finite or zero, a range or spacing that is not positive,
        errors out of range, more than 16,777,216 samples a view, or a map that keeps no free space.
    """
    T, d = _poses(poses), unit_directions(directions)
    reach = require_positive("max_range", max_range)
    require_errors(sensor_error, label_error, len(semantic_map.classes))
    gains = np.zeros((len(T), 2))
    if len(T) and len(d):
        start = T[0, :3, 3]
        require_occupancy(semantic_map, start)
        edge = semantic_map.resolution if spacing is None else require_positive("spacing", spacing)
        n_samples = _samples(reach, edge, len(d))
        for part in slices(len(T), max(1, _SAMPLES_AT_ONCE // (len(d) * n_samples))):
            voxels = _Voxels(semantic_map, edge, start, (sensor_error, label_error))
            gains[part] = _gains(voxels, T[part], d, n_samples)
    return InformationGain(gains[:, 0], gains[:, 1])


class _Voxels:
    """The voxels that rays have met, with their occupancy p (n,) and what a look at each tells (n, 2)."""

    def __init__(self, semantic_map: SpatialMap, edge: float, start: F64, errors: tuple[float, float]) -> None:
        self.edge, self.p, self.told = edge, np.empty(0), np.empty((0, 2))
        self._map, self._errors = semantic_map, errors
        self._table, self._origin = VoxelTable(), voxel_origin(start[None], edge)

    def rows(self, points: F64) -> I64:
        """Return the row (M,) of each point's voxel; the map is asked at the centres of new ones."""
        n_before = len(self._table)
        rows = self._table.insert(voxel_keys(points, self.edge, self._origin))
        centres = voxel_centres(self._table.keys[n_before:], self.edge, self._origin)
        p, told = np.empty(len(centres)), np.empty((len(centres), 2))
        for part, prediction in answers(self._map, centres):
            occupancy = occupancy_of(prediction)
            p[part] = occupancy.probability
            told[part, 0] = occupancy_information(p[part], self._errors[0])
            told[part, 1] = p[part] * class_information(prediction.probability, self._errors[1])
        self.p, self.told = np.concatenate([self.p, p]), np.concatenate([self.told, told])
        return rows


def _gains(voxels: _Voxels, T: F64, directions: F64, n_samples: int) -> F64:
    """Return the gains (V, 2) of views, whose rays are followed side by side, `_STAGE` samples at a time."""
    n_views, n_rays = len(T), len(directions)
    o = np.repeat(T[:, :3, 3], n_rays, axis=0)
    d = (directions @ np.swapaxes(T[:, :3, :3], 1, 2)).reshape(-1, 3)
    row = np.zeros((len(o), n_samples), dtype=np.int64)  # of the voxel of each sample
    reached = np.zeros((len(o), n_samples))  # with what probability; zero where a ray was given up
    going, ray = np.ones(len(o)), np.arange(len(o))
    for stage in slices(n_samples, _STAGE):
        t = (np.arange(stage.start, stage.stop) + 0.5) * voxels.edge
        points = o[ray, None] + t[:, None] * d[ray, None]
        met = voxels.rows(points.reshape(-1, 3)).reshape(points.shape[:2])
        clear = np.cumprod(1 - voxels.p[met], axis=1)
        before = np.concatenate([np.ones((len(ray), 1)), clear[:, :-1]], axis=1)
        row[ray, stage], reached[ray, stage] = met, going[ray, None] * before
        going[ray] *= clear[:, -1]
        ray = ray[going[ray] >= HARDLY]
    which, sample = np.nonzero(reached >= HARDLY)
    n_voxels = len(voxels.p)
    pairs = VoxelTable()  # of a view and a voxel
    pair = pairs.insert(which // n_rays * n_voxels + row[which, sample])
    greatest = np.zeros(len(pairs))
    np.maximum.at(greatest, pair, reached[which, sample])
    view, voxel = np.divmod(pairs.keys, n_voxels)
    parts = [np.bincount(view, greatest * voxels.told[voxel, i], n_views) for i in range(2)]
    return np.stack(parts, axis=1)


def _samples(max_range: float, spacing: float, n_rays: int) -> int:
    """Return how many samples a ray has."""
    n = samples_along(max_range, spacing)
    if n_rays * n > MOST_SAMPLES:
        raise InputError(
            f"{n_rays} rays of {n} samples are more than {MOST_SAMPLES:,} samples a view: take fewer rays, a "
            "shorter range or a wider spacing."
        )
    return n


def _poses(poses: ArrayLike) -> F64:
    T = as_array("poses", poses, np.float64)
    if T.ndim != 3 or T.shape[1:] != (4, 4):
        raise InputError(f"poses must have shape (V, 4, 4), not {T.shape}.")
    for i, pose in enumerate(T):
        rigid_transform(f"pose {i}", pose)
    return T
