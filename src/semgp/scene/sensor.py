"""A depth camera: its rays, its noise, and the pixels it does not answer for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.camera import Pinhole
from semgp.errors import InputError


@dataclass(frozen=True)
class DepthCamera:
    """A structured-light camera.

    Parameters
    ----------
    width, height : int
        Columns and rows of its image.
    focal : float
        Focal length in image widths; 0.81 sees 63 degrees, as the cameras of NYU Depth V2.
    noise : float
        Standard deviation of the depth at one metre, in metres; it grows with the square of the depth. The
        default is what Khoshelham & Elberink (2012) measured for the Kinect: 3.6 cm at five metres.
    grazing : float
        Cosine of the angle between ray and surface normal below which depth goes missing, the more often the
        smaller the cosine.
    dropout : float
        Share of pixels that go missing at random.

    Raises
    ------
    InputError
        Values outside their range.
    """

    width: int = 320
    height: int = 240
    focal: float = 0.81
    noise: float = 1.425e-3
    grazing: float = 0.15
    dropout: float = 0.01

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or not self.focal > 0:
            raise InputError("a camera needs at least one column and row, and a focal length above zero.")
        if not (self.noise >= 0 and 0 <= self.grazing <= 1 and 0 <= self.dropout < 1):
            raise InputError("noise must not be negative, grazing lies in [0, 1] and dropout in [0, 1).")

    @property
    def pinhole(self) -> Pinhole:
        """Pinhole model of the camera, the principal point in the middle of the image."""
        f = self.focal * self.width
        return Pinhole(f, f, (self.width - 1) / 2, (self.height - 1) / 2)

    @property
    def rays(self) -> NDArray[np.float64]:
        """Ray of each pixel in the camera's frame, shape (height, width, 3), scaled to a depth of one."""
        return self.pinhole.back_project(np.ones((self.height, self.width)))[0]

    def measure(
        self, depth: NDArray[np.float64], cosine: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float64]:
        """Return what the sensor answers: noisy depth, zero where it is missing.

        Parameters
        ----------
        depth, cosine : (height, width) array
            True depth in metres, and cosine of the angle between ray and surface normal.
        rng : numpy.random.Generator
            Source of the noise.
        """
        noisy = depth + self.noise * depth**2 * rng.standard_normal(depth.shape)
        returned = rng.random(depth.shape) * self.grazing <= cosine
        kept = rng.random(depth.shape) >= self.dropout
        return np.where(returned & kept & (noisy > 0), noisy, 0.0)
