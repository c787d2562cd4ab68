"""Query points in groups that need no more of a map than there is room for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from semgp.blocks.arrays import F64, I64
from semgp.maps.tiles import Tiling
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.voxels import voxel_keys


def groups(
    points: F64, tiling: Tiling, resolution: float, origin: I64, half: float, sizes: Mapping[int, int], most: int
) -> Iterator[tuple[I64, I64]]:
    """Yield rows of points, each row once, and the keys of the tiles that their answers depend on.

    Parameters
    ----------
    points : (M, 3) array
        Metres, world frame.
    tiling, resolution, origin, half
        See `Tiling.round_points`.
    sizes : mapping of int to int
        Sites of each tile that there is.
    most : int
        The sites of a group's tiles, unless those of a single tile's points are more.
    """
    needed = tiling.round_points(points, resolution, origin, half)
    if sum(sizes.get(tile, 0) for tile in needed.tolist()) <= most:
        yield np.arange(len(points)), needed
        return
    home = tiling.keys(voxel_keys(points, resolution, origin, allow_outside=True))
    order = np.argsort(home, kind="stable")
    rows: list[I64] = []
    tiles: set[int] = set()
    for mine in np.split(order, np.flatnonzero(np.diff(home[order])) + 1):
        more = set(tiling.round_points(points[mine], resolution, origin, half).tolist())
        if rows and sum(sizes.get(tile, 0) for tile in tiles | more) > most:
            yield np.concatenate(rows), np.array(sorted(tiles), dtype=np.int64)
            rows, tiles = [], set()
        rows.append(mine)
        tiles |= more
    yield np.concatenate(rows), np.array(sorted(tiles), dtype=np.int64)


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
