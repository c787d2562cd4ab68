"""A camera that goes round what it shows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.checks import as_array, require_finite
from semgp.errors import InputError
from semgp.picture.view import Z_UP, View, framed

F64 = NDArray[np.float64]

TOP = 90.0
"""Elevation of a view from straight above."""
_FRAMED = 0.9999
"""Share of the points that a view keeps inside of each edge of its frame."""
_ASKED = 20_000
"""Points, at most, that are looked at to find the best side."""
_SIDES = 8
"""Sides that are tried."""
_GRID = 96
"""Cells from side to side of the coarse picture in which points hide each other."""


@dataclass(frozen=True)
class Camera:
    """A camera outside of a cloud, by the side and the height from which it looks at it.

    Parameters
    ----------
    azimuth : float, optional
        The side, in degrees about the upward axis: with z up, 0 looks from +x, 90 from +y. Left out, the side from
        which most of the cloud is seen; from above, that with x to the right and y upwards.
    elevation : float
        Degrees above the level, from -90 to 90, which is straight from above.
    zoom : float
        1 fills the frame with the cloud, 2 shows its middle twice as large.
    up : (3,) array
        Upward direction of the world.
    fov : float
        Vertical field of view in degrees: the wider, the stronger the perspective.

    Raises
    ------
    InputError
        Values out of range, or no upward direction.
    """

    azimuth: float | None = None
    elevation: float = 35.0
    zoom: float = 1.0
    up: ArrayLike = Z_UP
    fov: float = 30.0

    def __post_init__(self) -> None:
        if self.azimuth is not None and not math.isfinite(self.azimuth):
            raise InputError(f"azimuth is an angle in degrees, not {self.azimuth}.")
        if not -90 <= self.elevation <= 90:
            raise InputError(f"elevation lies between -90 and 90 degrees, not {self.elevation}.")
        if not (math.isfinite(self.zoom) and self.zoom > 0):
            raise InputError(f"zoom must be a positive number, not {self.zoom}.")
        up = as_array("up", self.up, np.float64)
        if up.shape != (3,) or not (np.isfinite(up).all() and np.linalg.norm(up) > 0):
            raise InputError("up is the upward direction of the world, three numbers that are not all zero.")
        object.__setattr__(self, "up", up / np.linalg.norm(up))

    def view(self, points: F64, width: int, height: int) -> View:
        """Return the view that fills its frame with points (N, 3), N at least 1.

        Raises
        ------
        InputError
            No points, points that are not finite, or a frame that is none.
        """
        if points.ndim != 2 or points.shape[1] != 3 or not len(points):
            raise InputError(f"a view needs points of shape (N, 3), at least one; these are {points.shape}.")
        require_finite("points", points)
        azimuth = self._side(points) if self.azimuth is None else self.azimuth
        outward, upward = self._axes(azimuth)
        whole = framed(points, -outward, upward, fov=self.fov, width=width, height=height, share=_FRAMED)
        return whole.zoomed(self.zoom)

    def orbit(self, points: F64, width: int, height: int, frames: int) -> Iterator[View]:
        """Yield views of one turn around points, all from the same distance.

        Raises
        ------
        InputError
            As `view`, or not two frames at least.
        """
        if frames < 2:
            raise InputError(f"an orbit has two frames at least, not {frames}.")
        first = self._side(points) if self.azimuth is None else self.azimuth
        sides = [first + 360 * i / frames for i in range(frames)]
        middle = np.mean(np.quantile(points, (1 - _FRAMED, _FRAMED), axis=0), axis=0)
        back = max(self._distance(points, middle, side, width / height) for side in sides[:: -(-frames // 8)])
        for side in sides:
            outward, upward = self._axes(side)
            eye = middle + back * outward
            yield View.look_at(eye, middle, upward, fov=self.fov, width=width, height=height).zoomed(self.zoom)

    def _distance(self, points: F64, middle: F64, azimuth: float, aspect: float) -> float:
        """Return how far from the middle the eye sees the points around it in its frame."""
        outward, upward = self._axes(azimuth)
        tan_y = 0.97 * math.tan(math.radians(self.fov) / 2)
        P = points - middle
        across, along = abs(P @ np.cross(upward, outward)) / (tan_y * aspect), abs(P @ upward) / tan_y
        return float(np.quantile(P @ outward + np.maximum(across, along), _FRAMED))

    def _axes(self, azimuth: float) -> tuple[F64, F64]:
        """Return the direction from the cloud to the eye and the upward direction of the picture."""
        up = np.asarray(self.up, dtype=np.float64)
        first = np.eye(3)[1 if abs(up[0]) > 0.9 else 0]
        first = first - (first @ up) * up
        first /= np.linalg.norm(first)
        turn, rise = math.radians(azimuth), math.radians(self.elevation)
        level = math.cos(turn) * first + math.sin(turn) * np.cross(up, first)
        return (
            math.cos(rise) * level + math.sin(rise) * up,
            math.cos(rise) * up - math.sin(rise) * level,
        )

    def _side(self, points: F64) -> float:
        """Return the azimuth from which most points are seen; corners of what is long before its faces."""
        if abs(self.elevation) > 80:
            return -90.0 if self.elevation > 0 else 90.0
        some = points[:: -(-len(points) // _ASKED)]
        flat = some - some.mean(axis=0)
        along, across = self._axes_of_level()
        plan = np.column_stack([flat @ along, flat @ across])
        longest = np.linalg.svd(plan, full_matrices=False)[2][0] if len(some) > 2 else np.array([1.0, 0.0])
        turn = math.degrees(math.atan2(longest[1], longest[0]))
        sides = [turn - 60 + 360 * k / _SIDES for k in range(_SIDES)]
        return max(sides, key=lambda side: _seen(some, *self._axes(side)))

    def _axes_of_level(self) -> tuple[F64, F64]:
        flat = replace(self, elevation=0.0)
        return flat._axes(0.0)[0], flat._axes(90.0)[0]


def below_mask(points: F64, cut: float | None, up: ArrayLike) -> NDArray[np.bool_]:
    """Return which points (N, 3) lie no higher than `cut` metres along the unit vector `up`; all without a cut."""
    return np.ones(len(points), dtype=bool) if cut is None else np.asarray(points @ np.asarray(up) <= cut)


def below(points: F64, cut: float | None, up: ArrayLike) -> F64:
    """Return the points (n, 3) that lie no higher than a cut.

    Raises
    ------
    InputError
        None does.
    """
    kept = points[below_mask(points, cut, up)]
    if len(points) and not len(kept):
        heights = points @ np.asarray(up)
        raise InputError(
            f"nothing lies below {cut} m: the map reaches from {heights.min():.2f} to {heights.max():.2f} m."
        )
    return kept


def _seen(points: F64, outward: F64, upward: F64) -> int:
    """Return how many points lie foremost, or close to that, in the cells of a coarse picture from afar."""
    right = np.cross(upward, outward)
    across, along, near = points @ right, points @ upward, points @ outward
    edge = max(np.ptp(across), np.ptp(along), 1e-9) / _GRID
    column, row = ((v - v.min()) // edge for v in (across, along))
    cell = (row * (2 * _GRID) + column).astype(np.int64)
    foremost = np.full(cell.max() + 1, -np.inf)
    np.maximum.at(foremost, cell, near)
    return int(np.count_nonzero(near > foremost[cell] - 2 * edge))
