"""What an eye sees of a sample: light, backs of walls, the point that a ray meets."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.viewer.state import Shown

_GRAZING = 0.02
"""Sine of the angle up to which a wall is seen from behind all the same: what is flat there does not flicker."""


def lit(shown: Shown, up: ArrayLike) -> NDArray[np.uint8]:
    """Return the colours (K, 3) of what is seen, darker where the surface turns from a lamp above and aside.

    Parameters
    ----------
    shown : Shown
        What is seen.
    up : (3,) array
        Upward direction of the world, of length one.
    """
    lamp = np.add(up, (0.45, 0.3, 0.2))
    facing = np.abs(shown.normals @ lamp) / np.linalg.norm(lamp)
    share = np.where(shown.normals.any(axis=1), 0.7 + 0.3 * facing, 0.85)
    return np.rint(shown.colours * share[:, None]).astype(np.uint8)


def backs(shown: Shown, eye: ArrayLike) -> NDArray[np.bool_]:
    """Return which of the points that are seen (K,) belong to walls that turn their back to an eye.

    To see into a closed room from outside, leave them out.

    Parameters
    ----------
    shown : Shown
        What is seen.
    eye : (3,) array
        Where the eye is, metres, world frame.
    """
    sight = shown.points - np.asarray(eye, dtype=np.float64)
    along = np.einsum("ni,ni->n", shown.normals, sight)
    return np.asarray(shown.one_sided & (along > _GRAZING * np.sqrt(np.einsum("ni,ni->n", sight, sight))))


def pick(shown: Shown, origin: ArrayLike, direction: ArrayLike, *, see_inside: bool = False) -> int | None:
    """Return the row of the sample that a ray meets first, or None.

    A point is met where the ray passes within the sample's resolution, or a half per cent of the distance.

    Parameters
    ----------
    shown : Shown
        What is seen.
    origin, direction : (3,) array
        The ray, metres, world frame.
    see_inside : bool
        Whether it goes through walls that turn their back to its origin.
    """
    if not len(shown.rows):
        return None
    along = np.asarray(direction, dtype=np.float64)
    along = along / np.linalg.norm(along)
    to = shown.points - np.asarray(origin, dtype=np.float64)
    depth = to @ along
    aside = np.linalg.norm(to - depth[:, None] * along, axis=1)
    met = (depth > 0) & (aside < np.maximum(0.7 * shown.sample.resolution, 0.005 * depth))
    if see_inside:
        met &= ~backs(shown, origin)
    if not met.any():
        return None
    first = depth[met].min() + 2 * shown.sample.resolution  # of what lies there, the nearest to the ray
    candidates = np.flatnonzero(met & (depth <= first))
    return int(shown.rows[candidates[np.argmin(aside[candidates])]])
