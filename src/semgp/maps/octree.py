"""Any map with free space as an OctoMap, the tree that robots' planners read."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.maps.protocol import BATCH, SpatialMap
from semgp.octomap import SemanticOctoMap
from semgp.octomap.bricks import Bricks
from semgp.octomap.morton import DEPTH, HALF, OUTSIDE, cell_centres, voxel_codes
from semgp.octomap.sensor import SensorModel
from semgp.octomap.tree import Leaves
from semgp.parallel import slices


def to_octomap(semantic_map: SpatialMap, resolution: float | None = None) -> SemanticOctoMap:
    """Return the voxels in which a map has data, each with what the map says at its centre.

    Voxels that touch them are taken too where they are free: a map keeps thinned samples of its free space
    (`FreeSpace.thin`), and knows what is between them. Log-odds are kept within the bounds of OctoMap's sensor
    model, as OctoMap itself keeps them, so that alike voxels become one. Occupied voxels that the map has observed
    keep its class probabilities.

    Parameters
    ----------
    semantic_map : SpatialMap
        A map with free space.
    resolution : float, optional
        Edge of a voxel in metres; the map's own if left out. A finer one may leave gaps between the voxels.

    Returns
    -------
    SemanticOctoMap
        Its origin is the world's where the tree reaches all data from there, else the middle of the data.

    Raises
    ------
    InputError
        An empty map, one without free space, or data beyond the reach of a tree of this resolution.
    """
    positions = np.concatenate([semantic_map.occupied_positions, semantic_map.free_positions])
    if not len(positions):
        raise InputError("the map is empty: build it from scans with labels and a T_world_sensor.")
    edge = semantic_map.resolution if resolution is None else resolution
    empty = SemanticOctoMap(semantic_map.classes, edge, origin=_origin(positions, edge))
    local = positions - empty.origin
    own = np.unique(voxel_codes(local.astype(np.float32), edge))
    codes = _with_neighbours(own, local, edge)
    if codes[0] == OUTSIDE:
        raise InputError(
            f"the data spans more than {2 * HALF * edge:g} m, the reach of a tree of {edge:g} m: "
            "use a coarser resolution."
        )
    return _filled(empty, semantic_map, codes, np.isin(codes, own, assume_unique=True))


def _with_neighbours(own: NDArray[np.int64], local: NDArray[np.float64], edge: float) -> NDArray[np.int64]:
    """Return the codes, ascending, of the voxels that hold positions and of those that touch them."""
    steps = edge * np.stack(np.meshgrid(*[(-1, 0, 1)] * 3), axis=-1).reshape(-1, 3)
    found = [np.unique(voxel_codes((local + step).astype(np.float32), edge)) for step in steps]
    return np.unique(np.concatenate([own, *found]))


def _origin(positions: NDArray[np.float64], edge: float) -> NDArray[np.float64]:
    if np.abs(positions).max() < (HALF - 2) * edge:
        return np.zeros(3)
    return np.asarray((positions.min(axis=0) + positions.max(axis=0)) / 2)


def _filled(
    empty: SemanticOctoMap, semantic_map: SpatialMap, codes: NDArray[np.int64], own: NDArray[np.bool_]
) -> SemanticOctoMap:
    """Return the OctoMap of the voxels of which the map knows something, those that are not its own if free."""
    centres = cell_centres(codes, np.full(len(codes), DEPTH), empty.resolution) + empty.origin
    values, known = np.empty(len(codes), dtype=np.float32), np.empty(len(codes), dtype=bool)
    for part in slices(len(codes), BATCH):
        occupancy = semantic_map.occupancy(centres[part])
        values[part], known[part] = _clamped(occupancy.probability, empty.sensor), occupancy.known
    occupied = empty.sensor.occupied(values)
    known &= own | ~occupied
    there = known & occupied
    leaves = Leaves(codes[known], np.full(np.count_nonzero(known), DEPTH), values[known])
    labels = _labels(semantic_map, codes[there], centres[there])
    header, arrays = empty.to_arrays()
    return SemanticOctoMap.from_arrays(
        semantic_map.classes, header, arrays | Bricks.from_leaves(leaves).to_arrays() | labels
    )


def _labels(
    semantic_map: SpatialMap, codes: NDArray[np.int64], centres: NDArray[np.float64]
) -> dict[str, NDArray[Any]]:
    """Return the class probabilities of voxels as an OctoMap stores them, see `VoxelLabels.to_arrays`."""
    counts = np.zeros(len(codes), dtype=np.int64)
    labels, masses = [np.empty(0, dtype=np.int32)], [np.empty(0, dtype=np.float32)]
    for part in slices(len(codes), BATCH):
        prediction = semantic_map.query(centres[part])
        share = np.where(prediction.observed[:, None], prediction.probability, 0).astype(np.float32)
        counts[part] = np.count_nonzero(share, axis=1)
        labels.append(np.nonzero(share)[1].astype(np.int32))
        masses.append(share[share > 0])
    some = counts > 0
    return {
        "voxels": codes[some],
        "voxel_classes": counts[some],
        "class": np.concatenate(labels),
        "mass": np.concatenate(masses),
    }


def _clamped(probability: NDArray[np.floating], sensor: SensorModel) -> NDArray[np.float32]:
    """Return log-odds within the bounds of a sensor model."""
    p = np.clip(probability, sensor.clamp_min, sensor.clamp_max)
    return np.asarray(np.log(p / (1 - p)), dtype=np.float32)
