"""Where a picture is taken from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.checks import rigid_transform
from semgp.errors import InputError

Z_UP = (0.0, 0.0, 1.0)
_FRAMED = 0.995
"""Share of the points that an automatic view keeps inside of its frame: outliers don't count."""


@dataclass(frozen=True, eq=False)
class View:
    """A camera that takes a picture of points.

    Parameters
    ----------
    T_world_camera : (4, 4) array
        Pose of the camera's optical frame in the world: x right, y down, z forward.
    fov : float
        Vertical field of view in degrees, between 0 and 180.
    width, height : int
        Columns and rows of the picture.

    Raises
    ------
    InputError
        A pose that is no rigid transform, or values outside their range.
    """

    T_world_camera: NDArray[np.float64]
    fov: float = 45.0
    width: int = 960
    height: int = 720

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_camera", rigid_transform("T_world_camera", self.T_world_camera))
        if not 0 < self.fov < 180:
            raise InputError(f"fov, the vertical field of view, lies between 0 and 180 degrees, not {self.fov}.")
        if self.width < 1 or self.height < 1:
            raise InputError(f"a picture has at least one pixel, not {self.width} x {self.height}.")

    @classmethod
    def look_at(
        cls,
        eye: ArrayLike,
        target: ArrayLike,
        up: ArrayLike = Z_UP,
        *,
        fov: float = 45.0,
        width: int = 960,
        height: int = 720,
    ) -> View:
        """Return the view from `eye` towards `target`, positions (3,) in metres, with `up` upwards.

        Raises
        ------
        InputError
            Eye and target that coincide, or a direction of view along `up`.
        """
        eye, target, up = (np.asarray(v, dtype=np.float64) for v in (eye, target, up))
        forward, right = target - eye, np.cross(target - eye, up)
        if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(forward) * np.linalg.norm(up):
            raise InputError("the direction from eye to target must not vanish or run along up: move the eye.")
        forward, right = forward / np.linalg.norm(forward), right / np.linalg.norm(right)
        T = np.eye(4)
        T[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
        T[:3, 3] = eye
        return cls(T, fov, width, height)

    @property
    def focal(self) -> float:
        """Focal length in pixels."""
        return self.height / 2 / math.tan(math.radians(self.fov) / 2)

    @property
    def eye(self) -> NDArray[np.float64]:
        """Position (3,) of the eye in the world."""
        return self.T_world_camera[:3, 3]

    def zoomed(self, zoom: float) -> View:
        """Return the view with what is in its middle so many times as large: a narrower field of view."""
        fov = 2 * math.degrees(math.atan(math.tan(math.radians(self.fov) / 2) / zoom))
        return replace(self, fov=fov)

    def to_camera(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (N, 3) of the world in the camera's frame."""
        return (points - self.T_world_camera[:3, 3]) @ self.T_world_camera[:3, :3]


def view_of(
    points: ArrayLike,
    origin: ArrayLike | None = None,
    *,
    up: ArrayLike = Z_UP,
    tilt: float = 6.0,
    fov: float = 45.0,
    width: int = 960,
    height: int = 720,
) -> View:
    """Return a view that fills its frame with a cloud.

    The view is that of the sensor, raised by `tilt` degrees about the cloud's middle and stepped back until
    the cloud fits. A cloud all around its sensor, or one whose sensor is not known, is seen from a corner above.

    Parameters
    ----------
    points : (N, 3) array
        Positions in metres, N at least 1.
    origin : (3,) array, optional
        Position of the sensor in the world.
    up : (3,) array
        Upward direction of the world.
    tilt : float
        By how many degrees the eye looks down more steeply than the sensor.
    fov, width, height
        As for `View`.

    Raises
    ------
    InputError
        No points, points of the wrong shape or not finite, or no upward direction.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
        raise InputError(f"a view needs finite points of shape (N, 3), at least one; these are {points.shape}.")
    if not np.linalg.norm(up) > 0:
        raise InputError("up is the upward direction of the world and must not vanish.")
    up = np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    middle = np.median(points, axis=0)
    forward = _direction(points, middle, origin, up, math.radians(tilt))
    return framed(points, forward, up, fov=fov, width=width, height=height)


def framed(
    points: NDArray[np.float64],
    forward: NDArray[np.float64],
    up: ArrayLike,
    *,
    fov: float = 45.0,
    width: int = 960,
    height: int = 720,
    share: float = _FRAMED,
) -> View:
    """Return the view along `forward`, a unit vector (3,), stepped back until points (N, 3) fill its frame.

    `share` is the part of the points that is to lie on the inner side of each of the frame's edges.

    Raises
    ------
    InputError
        A direction of view along `up`, or a frame that is none.
    """
    middle = np.median(points, axis=0)
    near = View.look_at(middle - forward, middle, up, fov=fov, width=width, height=height)
    x, y, z = (near.to_camera(points) - (0, 0, 1)).T
    tan_y = 0.97 * math.tan(math.radians(fov) / 2)
    tan_x = tan_y * width / height
    # a point is in the frame once the eye is +-x / tan_x - z behind the middle, and likewise for y
    left, right = (np.quantile(s * x / tan_x - z, share) for s in (-1, 1))
    above, below = (np.quantile(s * y / tan_y - z, share) for s in (-1, 1))
    aside = (right - left) / 2 * tan_x * near.T_world_camera[:3, 0]
    lower = (below - above) / 2 * tan_y * near.T_world_camera[:3, 1]
    back = max((left + right) / 2, (above + below) / 2, 1e-3)
    target = middle + aside + lower
    return View.look_at(target - back * forward, target, up, fov=fov, width=width, height=height)


def _direction(
    points: NDArray[np.float64],
    middle: NDArray[np.float64],
    origin: ArrayLike | None,
    up: NDArray[np.float64],
    tilt: float,
) -> NDArray[np.float64]:
    """Return the direction of view: the sensor's, tilted down, or from a corner above."""
    if origin is not None:
        origin = np.asarray(origin, dtype=np.float64)
        sight = middle - origin
        level = sight - (sight @ up) * up
        reach = np.median(np.linalg.norm(points - origin, axis=1))
        if np.linalg.norm(level) > 0.3 * reach:
            pitch = math.atan2(sight @ up, np.linalg.norm(level)) - tilt
            return np.asarray(math.cos(pitch) * level / np.linalg.norm(level) + math.sin(pitch) * up)
    side = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    level = side / np.linalg.norm(side) + np.cross(up, side) / np.linalg.norm(side)
    corner = level / np.linalg.norm(level) - 0.8 * up
    return np.asarray(corner / np.linalg.norm(corner))
