"""Query points in groups that need no more of a map than there is room for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from semgp.blocks.arrays import F64, I64
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.store.settings import Settings
from semgp.voxels import voxel_indices, voxel_keys


def groups(
    points: F64,
    settings: Settings,
    origin: I64,
    sizes: Mapping[int, int],
    most_sites: int,
    most_points: int | None = None,
) -> Iterator[tuple[I64, I64]]:
    """Yield rows of points, each row once, and the keys of the tiles that their answers depend on.

    All rows in their order where that is little enough. Else the box of their tiles is halved across its longest
    edge, again and again: what is left is compact, and neighbours follow each other.

    Parameters
    ----------
    points : (M, 3) array
        Metres, world frame.
    settings : Settings
        Of the map.
    origin : (3,) array
        Voxel where its keys begin.
    sizes : mapping of int to int
        Sites of each tile that there is.
    most_sites : int
        The sites of a group's tiles, unless those of a single tile's points are more.
    most_points : int, optional
        The points of a group; any number by default.
    """

    def near(rows: I64) -> I64:
        return settings.tiling.round_points(points[rows], settings.resolution, origin, settings.half_blend)

    def fit(rows: I64, tiles: I64) -> bool:
        few = most_points is None or len(rows) <= most_points
        return few and sum(sizes.get(tile, 0) for tile in tiles.tolist()) <= most_sites

    rows = np.arange(len(points))
    if fit(rows, tiles := near(rows)):
        yield rows, tiles
        return
    home = settings.tiling.keys(voxel_keys(points, settings.resolution, origin, allow_outside=True))
    order = np.argsort(home, kind="stable")
    homes, first = np.unique(home[order], return_index=True)
    rows_of = np.split(order, first[1:])
    near_to = [near(rows) for rows in rows_of]
    place = voxel_indices(homes, origin)
    left = [np.arange(len(homes))]
    while left:
        box = left.pop()
        rows = np.concatenate([rows_of[i] for i in box])
        tiles = np.unique(np.concatenate([near_to[i] for i in box]))
        if fit(rows, tiles):
            yield rows, tiles
        elif len(box) > 1:
            along = place[box, np.argmax(np.ptp(place[box], axis=0))]
            steps = np.unique(along)
            high = along >= steps[len(steps) // 2]
            left += [box[high], box[~high]]
        else:
            n = -(-len(rows) // (most_points or len(rows)))
            yield from ((some, tiles) for some in np.array_split(rows, n))


def in_order(parts: Sequence[Prediction], rows: Sequence[I64]) -> Prediction:
    """Return the answers for all points from those of the groups, whose rows are given.

    For maps whose classes share a variance.
    """
    if len(parts) == 1:
        return parts[0]
    place = np.argsort(np.concatenate(rows))
    probability = np.concatenate([part.probability for part in parts])[place]
    variance = np.concatenate([part.variance[:, 0] for part in parts if part.variance is not None])[place]
    return Prediction(
        parts[0].classes,
        probability,
        np.concatenate([part.observed for part in parts])[place],
        variance=np.broadcast_to(variance[:, None], probability.shape),
        occupancy=None
        if parts[0].occupancy is None
        else occupancy_in_order([part.occupancy for part in parts if part.occupancy is not None], rows),
    )


def occupancy_in_order(parts: Sequence[OccupancyPrediction], rows: Sequence[I64]) -> OccupancyPrediction:
    """Return what is said of all points from what is said of the groups."""
    place = np.argsort(np.concatenate(rows))
    probability, known = (
        np.concatenate(values)[place] for values in zip(*((p.probability, p.known) for p in parts))
    )
    return OccupancyPrediction(probability, known)
