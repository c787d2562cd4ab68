"""Lenses: where on the image plane the light of a direction falls, and which direction a point of it sees.

A direction is (x, y), the point in which its line cuts the plane z = 1; where the light of it falls is (x', y'),
which times the focal lengths plus the principal point is a pixel of the raw image. Formulas are those of ROS'
CameraInfo, which are OpenCV's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError

Plane = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Coordinates x and y of points of a plane, of one shape."""

EXACT = 1e-10
"""A direction is found when its light falls so close to where it should, in focal lengths."""

_ANGLES = np.linspace(0, math.radians(89), 4096)
"""Angles from the optical axis (rad) at which lenses are tabulated."""

_STEPS = 20


class Lens(Protocol):
    """A model of a lens."""

    def distort(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Plane:
        """Return where the light of directions falls."""
        ...

    def undistort(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Plane:
        """Return the directions whose light falls on points; NaN where there is none that can be trusted.

        A direction is trusted when `distort` leads back to its point to within `EXACT`, and when it lies before
        the angle at which the model folds over and would see a second direction at the same point.
        """
        ...


@dataclass(frozen=True)
class BrownConrady:
    """`plumb_bob` (k1, k2, p1, p2, k3) and `rational_polynomial` (k4, k5, k6 as well) of ROS.

    With r² = x² + y² and R = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶):
    x' = x R + 2 p1 x y + p2 (r² + 2 x²) and y' = y R + p1 (r² + 2 y²) + 2 p2 x y.
    """

    k1: float
    k2: float
    p1: float
    p2: float
    k3: float = 0.0
    k4: float = 0.0
    k5: float = 0.0
    k6: float = 0.0

    def distort(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Plane:
        """Return where the light of directions falls."""
        r2 = x * x + y * y
        R = self._radial(r2)
        return (
            x * R + 2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x),
            y * R + self.p1 * (r2 + 2 * y * y) + 2 * self.p2 * x * y,
        )

    def undistort(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Plane:
        """Return the directions of points by Newton's method; see `Lens`."""
        with np.errstate(all="ignore"):  # hostile coefficients overflow; what is not finite is left out
            slopes = np.tan(_ANGLES)
            table = _rising(slopes * self._radial(slopes**2))
            radius = np.hypot(x, y)
            start = np.interp(radius, table, slopes[: len(table)], right=np.nan)
            scale = np.divide(start, radius, out=np.ones_like(radius), where=radius > 0)
            u, v = x * scale, y * scale
            for _ in range(_STEPS):
                found = self.distort(u, v)
                ex, ey = found[0] - x, found[1] - y
                if not (np.hypot(ex, ey) > EXACT).any():
                    break
                xx, xy, yy = self._jacobian(u, v)
                determinant = xx * yy - xy * xy
                u, v = u - (yy * ex - xy * ey) / determinant, v - (xx * ey - xy * ex) / determinant
            good = (np.hypot(ex, ey) <= EXACT) & (np.hypot(u, v) <= slopes[len(table) - 1])
        return np.where(good, u, np.nan), np.where(good, v, np.nan)

    def _radial(self, r2: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return R."""
        above = 1 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        return above / (1 + r2 * (self.k4 + r2 * (self.k5 + r2 * self.k6)))

    def _radial_slope(self, r2: NDArray[np.float64], R: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of R by r²."""
        above = self.k1 + r2 * (2 * self.k2 + r2 * 3 * self.k3)
        below = self.k4 + r2 * (2 * self.k5 + r2 * 3 * self.k6)
        return (above - R * below) / (1 + r2 * (self.k4 + r2 * (self.k5 + r2 * self.k6)))

    def _jacobian(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Sequence[NDArray[np.float64]]:
        """Return dx'/dx, dx'/dy = dy'/dx and dy'/dy."""
        r2 = x * x + y * y
        R = self._radial(r2)
        dR = self._radial_slope(r2, R)
        return (
            R + 2 * dR * x * x + 2 * self.p1 * y + 6 * self.p2 * x,
            2 * dR * x * y + 2 * self.p1 * x + 2 * self.p2 * y,
            R + 2 * dR * y * y + 6 * self.p1 * y + 2 * self.p2 * x,
        )


@dataclass(frozen=True)
class Equidistant:
    """`equidistant` of ROS, the fisheye model of Kannala and Brandt (2006) as OpenCV has it.

    At an angle t = atan(r) from the axis: r' = t (1 + k1 t² + k2 t⁴ + k3 t⁶ + k4 t⁸), in the same direction.
    """

    k1: float
    k2: float
    k3: float
    k4: float

    def distort(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Plane:
        """Return where the light of directions falls."""
        r = np.hypot(x, y)
        scale = np.divide(self._radius(np.arctan(r))[0], r, out=np.ones_like(r), where=r > 0)
        return x * scale, y * scale

    def undistort(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Plane:
        """Return the directions of points by Newton's method; see `Lens`."""
        with np.errstate(all="ignore"):  # as above
            table = _rising(self._radius(_ANGLES)[0])
            radius = np.hypot(x, y)
            t = np.interp(radius, table, _ANGLES[: len(table)], right=np.nan)
            for _ in range(_STEPS):
                found, slope = self._radius(t)
                if not (np.abs(found - radius) > EXACT).any():
                    break
                t = t - (found - radius) / slope
            good = (np.abs(found - radius) <= EXACT) & (t <= _ANGLES[len(table) - 1])
            scale = np.divide(np.tan(t), radius, out=np.ones_like(radius), where=radius > 0)
        return np.where(good, x * scale, np.nan), np.where(good, y * scale, np.nan)

    def _radius(self, t: NDArray[np.float64]) -> Plane:
        """Return r' and its derivative by the angle."""
        t2 = t * t
        return (
            t * (1 + t2 * (self.k1 + t2 * (self.k2 + t2 * (self.k3 + t2 * self.k4)))),
            1 + t2 * (3 * self.k1 + t2 * (5 * self.k2 + t2 * (7 * self.k3 + t2 * 9 * self.k4))),
        )


def _rising(radii: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the radii of a table up to where they no longer grow."""
    falls = np.flatnonzero(~(np.diff(radii) > 0))
    return radii[: falls[0] + 1] if len(falls) else radii


_MODELS: dict[str, tuple[type[BrownConrady] | type[Equidistant], tuple[int, ...]]] = {
    "plumb_bob": (BrownConrady, (4, 5)),
    "rational_polynomial": (BrownConrady, (8,)),
    "equidistant": (Equidistant, (4,)),
}


def lens_of(model: str, coefficients: Sequence[float]) -> Lens:
    """Return the lens of a model's name and coefficients, as a CameraInfo of ROS has them.

    Raises
    ------
    InputError
        A model that is not known, or coefficients that are not as many as it has or not finite.
    """
    if model not in _MODELS:
        raise InputError(
            f"its lens is of the model {model!r}, not one of {', '.join(_MODELS)}: rectify the images (ROS: "
            "image_proc) and take the rectified topics."
        )
    kind, counts = _MODELS[model]
    if len(coefficients) not in counts or not np.isfinite(coefficients).all():
        raise InputError(
            f"a lens of the model {model} has {' or '.join(map(str, counts))} finite coefficients, "
            f"not {list(coefficients)}."
        )
    return kind(*map(float, coefficients))
