"""Labels added to sites, in integers: compiled loops of `semgp.blocks.sites`."""

from __future__ import annotations

import numpy as np
from numba import njit

from semgp.blocks.arrays import F32, F64, I32, I64, U32

MASS_UNIT = 1 << 12
"""Steps of a class mass of one label."""

PLACE_UNIT = 1 << 24
"""Steps of a position within its voxel: 12 nanometres at 0.2 m."""

FEATURE_UNIT = 1 << 16
"""Steps of a feature of 1."""

SPREAD_UNIT = 1 << 24
"""Steps of a variance of 1 m^2."""

_FULL = 1 << 31
"""Mass of a site, half a million labels, beyond which labels change nothing and are not added: sums never wrap."""


@njit(cache=True, nogil=True)
def chain(
    cells: I32,
    known: int,
    head: I32,
    size: I32,
    following: I32,
) -> None:
    """Put new sites, from number `known` on, at the heads of their cells' chains."""
    for i in range(len(cells)):
        c = cells[i]
        following[known + i] = head[c]
        head[c] = known + i
        size[c] += 1


@njit(cache=True, nogil=True)
def add_hard(
    rows: I64,
    labels: I32,
    amounts: I64,
    points: F64,
    resolution: float,
    features: F32,
    cell: I32,
    mass: U32,
    place: I64,
    drift: F64,
) -> None:
    """Add a label to each row's site, of a mass `amounts` (N,); see `semgp.blocks.sites.Sites` for `drift`.

    Where a site is full, the amount is set to 0.
    """
    for i in range(len(rows)):
        r, total = rows[i], np.int64(0)
        for c in range(mass.shape[1]):
            total += np.int64(mass[r, c])
        if total > _FULL:
            amounts[i] = 0
            continue
        w = amounts[i]
        drift[cell[r]] += (1.5 - mass[r, labels[i]] / total) * w / (total + w) if total else 1.0
        mass[r, labels[i]] += np.uint32(w)
        _add_place(r, w, points[i], resolution, features[i], place)


@njit(cache=True, nogil=True)
def add_soft(
    rows: I64,
    weights: F32,
    amounts: I64,
    points: F64,
    resolution: float,
    features: F32,
    cell: I32,
    mass: U32,
    place: I64,
    drift: F64,
) -> None:
    """Add class weights (N, C) to each row's site, and fill in their sums `amounts` (N,).

    Where sites have a column more than there are classes, what the weights lack to `amounts` as given goes there.
    """
    for i in range(len(rows)):
        r, total, added, agreed = rows[i], np.int64(0), np.int64(0), 0.0
        for c in range(mass.shape[1]):
            total += np.int64(mass[r, c])
        if total > _FULL:
            amounts[i] = 0
            continue
        for c in range(mass.shape[1]):
            w = max(amounts[i] - added, np.int64(0))
            if c < weights.shape[1]:
                w = np.int64(np.rint(weights[i, c] * MASS_UNIT))
            added += w
            agreed += float(w) * float(mass[r, c])
            mass[r, c] += np.uint32(w)
        amounts[i] = added
        drift[cell[r]] += (
            (1.5 - agreed / (float(total) * float(added))) * added / (total + added) if total else 1.0
        )
        _add_place(r, added, points[i], resolution, features[i], place)


@njit(cache=True, nogil=True)
def add_spread(rows: I64, amounts: I64, variances: F64, draws: I64, spread: I64) -> None:
    """Add mass times variance (N, 3) to each row's sums, and the bits `draws` (N,) to its set of draws."""
    for i in range(len(rows)):
        r = rows[i]
        for d in range(3):
            spread[r, d] += amounts[i] * int(np.rint(variances[i, d] * SPREAD_UNIT))
        spread[r, 3] |= draws[i]


@njit(cache=True, nogil=True)
def fade_cells(cells: I64, factors: F64, head: I32, following: I32, mass: U32, place: I64, spread: I64) -> None:
    """Multiply the mass of all sites of some cells by a factor each."""
    for i in range(len(cells)):
        r = head[cells[i]]
        while r >= 0 and factors[i] < 1:
            _fade(r, factors[i], mass, place, spread)
            r = following[r]


@njit(cache=True, nogil=True)
def fade_rows(rows: I64, factor: float, cell: I32, mass: U32, place: I64, spread: I64, drift: F64) -> None:
    """Multiply the mass of some sites by a factor."""
    for r in rows:
        drift[cell[r]] += (1 - factor) / 2
        _fade(r, factor, mass, place, spread)


@njit(cache=True, nogil=True)
def _fade(r: int, factor: float, mass: U32, place: I64, spread: I64) -> None:
    """Multiply the mass of a site by a factor, its place and variance left as they are; one step of mass stays."""
    before, after, top = np.int64(0), np.int64(0), 0
    for c in range(mass.shape[1]):
        top = c if mass[r, c] > mass[r, top] else top
    for c in range(mass.shape[1]):
        before += np.int64(mass[r, c])
        mass[r, c] = np.uint32(np.rint(mass[r, c] * factor))
        after += np.int64(mass[r, c])
    if after == 0:
        mass[r, top], after = 1, np.int64(1)
    share = after / before
    for d in range(place.shape[1]):
        place[r, d] = np.int64(np.rint(place[r, d] * share))
    for d in range(3 if len(spread) else 0):
        spread[r, d] = np.int64(np.rint(spread[r, d] * share))


@njit(cache=True, nogil=True)
def _add_place(row: np.int64, w: int | np.int64, point: F64, resolution: float, features: F32, place: I64) -> None:
    """Add mass w at a point, and its features, to a site's sums."""
    for d in range(3):
        v = point[d] / resolution
        place[row, d] += w * int(np.rint((v - np.floor(v)) * PLACE_UNIT))
    for f in range(len(features)):
        place[row, 3 + f] += w * int(np.rint(features[f] * FEATURE_UNIT))
