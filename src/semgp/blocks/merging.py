"""Sites of several maps as one: moved, put into other voxels, and summed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.blocks.accumulate import PLACE_UNIT
from semgp.blocks.arrays import F64, I64, U32
from semgp.blocks.cells import cell_corner
from semgp.errors import InputError
from semgp.voxels import EXACT, HALF_RANGE, MARGIN, STEP, VoxelTable, voxel_indices

MOST_MASS = (1 << 32) - 1
"""The mass that a site can hold: a million labels."""


class Sums(NamedTuple):
    """Sites by the voxels of the world, in which several may share one.

    voxels (S, 3): indices, counted from the world's origin. mass (S, C), place (S, 3 + F) and spread (S, 4), or
    (0, 4): see `Sites`. origin (3,): the corner of a cell near by.
    """

    voxels: I64
    mass: U32
    place: I64
    spread: I64
    origin: I64


def stored_sums(arrays: Mapping[str, NDArray[Any]], prefix: str = "") -> Sums:
    """Return the sums in arrays that `Sites.to_arrays` gave, their names prefixed."""
    voxels, mass, place, origin = (arrays[prefix + name] for name in ("voxels", "mass", "place", "origin"))
    spread = arrays.get(prefix + "spread", np.empty((0, 4), dtype=np.int64))
    return Sums(voxel_indices(voxels, origin), mass, place, spread, origin)


def moved(sums: Sums, T: F64, resolution: float, new: float) -> Sums:
    """Return the same sites elsewhere, each as a whole in the voxel in which its mean now lies.

    Without a turn, and by whole voxels, that is exact.

    Parameters
    ----------
    sums : Sums
        Sites.
    T : (4, 4) array
        Rigid transform.
    resolution, new : float
        Edges in metres of the voxels so far and from now on.

    Raises
    ------
    InputError
        A transform to where neighbouring voxels cannot be told apart.
    """
    R, t = T[:3, :3], T[:3, 3]
    if not (np.abs(t) < EXACT * new).all():
        raise InputError(
            f"the transform moves a map by {t} m, too far for voxels of {new:g} m: choose a nearer frame."
        )
    shift = np.rint(t / new)
    turned = not np.allclose(R, np.eye(3), rtol=0, atol=1e-12)
    if new == resolution and not turned and np.allclose(t / new, shift, rtol=0, atol=1e-6):
        whole = shift.astype(np.int64)
        return sums._replace(voxels=sums.voxels + whole, origin=cell_corner(sums.origin + whole))
    total = sums.mass.sum(axis=1, dtype=np.int64)[:, None]
    mean = (sums.voxels + sums.place[:, :3] / (total * float(PLACE_UNIT))) * resolution
    v = (mean @ R.T + t) / new
    voxels = np.floor(v).astype(np.int64)
    within = total * np.rint((v - voxels) * PLACE_UNIT).astype(np.int64)
    # the diagonal of R diag(s) R^T
    variance = np.rint(sums.spread[:, :3] @ (R**2).T).astype(np.int64)
    return Sums(
        voxels,
        sums.mass,
        np.hstack([within, sums.place[:, 3:]]),
        np.hstack([variance, sums.spread[:, 3:]]),
        cell_corner(voxels[0]) if len(voxels) else sums.origin,
    )


def joined(parts: Sequence[Sums], origin: I64) -> dict[str, NDArray[Any]]:
    """Return the sums over all parts, voxel by voxel, as arrays for `Sites.restore`.

    Where two sites together have more mass than one can hold, a million labels, the heavier stays as it is.

    Parameters
    ----------
    parts : sequence of Sums
        At least one.
    origin : (3,) array
        Voxel at the origin of the keys, the corner of a cell.

    Raises
    ------
    InputError
        Voxels beyond the range of the keys.
    """
    table = VoxelTable()
    rows = [table.insert(_keys(part.voxels, origin)) for part in parts]
    n, first = len(table), parts[0]
    mass, place = np.zeros((n, first.mass.shape[1]), np.uint32), np.zeros((n, first.place.shape[1]), np.int64)
    uncertain = any(len(part.spread) for part in parts)
    spread = np.zeros((n if uncertain else 0, 4), np.int64)
    for part, at in zip(parts, rows):
        _add(at, part.mass, part.place, part.spread, mass, place, spread)
    arrays: dict[str, NDArray[Any]] = {"voxels": table.keys, "mass": mass, "place": place, "origin": origin}
    return arrays | ({"spread": spread} if uncertain else {})


def _keys(voxels: I64, origin: I64) -> I64:
    """The keys of voxels (V, 3) of the world."""
    away = voxels - origin
    if not ((away >= MARGIN - HALF_RANGE) & (away < HALF_RANGE - MARGIN)).all():
        raise InputError(
            f"the maps lie too far apart: {np.abs(away).max():,} voxels, and a map reaches "
            f"{HALF_RANGE - MARGIN:,} from where it began. Check the transform, take larger voxels, or ask a "
            "Committee of the maps."
        )
    return np.asarray((away + HALF_RANGE) @ np.array(STEP, dtype=np.int64))


@njit(cache=True, nogil=True)
def _add(rows: I64, m: U32, p: I64, s: I64, mass: U32, place: I64, spread: I64) -> None:
    """Add mass m, place p and spread s to each row's site."""
    for i in range(len(rows)):
        r, before, more = rows[i], np.int64(0), np.int64(0)
        for c in range(mass.shape[1]):
            before += np.int64(mass[r, c])
            more += np.int64(m[i, c])
        if before + more > MOST_MASS:
            if more <= before:
                continue
            mass[r : r + 1], place[r : r + 1], spread[r : r + 1] = 0, 0, 0
        for c in range(mass.shape[1]):
            mass[r, c] += m[i, c]
        for d in range(place.shape[1]):
            place[r, d] += p[i, d]
        if len(s):
            for d in range(3):
                spread[r, d] += s[i, d]
            spread[r, 3] |= s[i, 3]
