"""A camera whose images are as its lens made them: not rectified."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.camera import Pinhole, valid_depths
from semgp.lenses import Lens
from semgp.parallel import slices

_BAND = 1 << 15
"""So many pixels are undistorted at once: what is worked on stays in the cache."""


@dataclass(frozen=True)
class DistortedCamera:
    """A camera with a lens; what `Pinhole` is without one.

    Parameters
    ----------
    pinhole : Pinhole
        Intrinsics of the raw images.
    lens : Lens
        What happens to the light before it falls on them; see `semgp.lenses.lens_of`.
    """

    pinhole: Pinhole
    lens: Lens

    def back_project(
        self, depth_m: ArrayLike, max_depth: float = math.inf
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the point that each pixel sees: its depth times its ray; see `Pinhole.back_project`.

        Pixels whose ray cannot be found are not valid: see `Lens.undistort`.
        """
        z, valid = valid_depths(depth_m, max_depth)
        rays = _rays(self, (z.shape[0], z.shape[1]))
        valid &= np.isfinite(rays[..., 0])
        points = rays * z[..., None]
        points[~valid] = np.nan
        return points, valid


@lru_cache(maxsize=2)  # a frame takes some hundredths of the time that its camera's rays take
def _rays(camera: DistortedCamera, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return the ray (x, y, 1) of each pixel of an image, (H, W, 3); x and y are NaN where there is none."""
    at, rays = camera.pinhole, np.ones((*shape, 3))
    x = (np.arange(shape[1]) - at.cx) / at.fx
    y = (np.arange(shape[0]) - at.cy) / at.fy
    for rows in slices(shape[0], max(1, _BAND // max(1, shape[1]))):
        plane = np.meshgrid(x, y[rows])
        rays[rows, :, 0], rays[rows, :, 1] = camera.lens.undistort(plane[0], plane[1])
    rays.setflags(write=False)
    return rays
