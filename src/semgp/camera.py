"""A pinhole camera, and the cloud that an RGB-D frame becomes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.upward import Up


class Camera(Protocol):
    """What makes points of depth images: `Pinhole`, or `semgp.distortion.DistortedCamera`."""

    def back_project(
        self, depth_m: ArrayLike, max_depth: float = math.inf
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the point that each pixel sees, and where it sees one; see `Pinhole.back_project`."""
        ...


@dataclass(frozen=True)
class Pinhole:
    """Intrinsics of a camera without distortion, in pixels.

    The pixel in column u and row v, counted from 0, is the point (u, v) of the image plane: (0, 0) is the
    centre of the first pixel. The camera's frame is the optical frame of ROS REP-103: x right, y down,
    z forward.

    Parameters
    ----------
    fx, fy : float
        Focal lengths.
    cx, cy : float
        Principal point, column and row.

    Raises
    ------
    InputError
        Focal lengths that are not positive, or values that are not finite.
    """

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) for v in (self.fx, self.fy, self.cx, self.cy)):
            raise InputError(f"camera intrinsics must be finite numbers of pixels, not {self}.")
        if self.fx <= 0 or self.fy <= 0:
            raise InputError(f"focal lengths must be positive, not fx {self.fx}, fy {self.fy}.")

    def back_project(
        self, depth_m: ArrayLike, max_depth: float = math.inf
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the point that each pixel sees: x = (u - cx) d / fx, y = (v - cy) d / fy, z = d.

        Parameters
        ----------
        depth_m : (H, W) array
            Depth along z, in metres.
        max_depth : float
            Depths beyond it, in metres, are not believed.

        Returns
        -------
        points : (H, W, 3) float64 array
            Points in the camera's frame, metres; NaN where the pixel is not valid.
        valid : (H, W) bool array
            False where the depth is zero, negative, NaN, infinite or beyond `max_depth`.

        Raises
        ------
        InputError
            A depth image that is not two-dimensional.
        """
        z, valid = valid_depths(depth_m, max_depth)
        u, v = np.arange(z.shape[1]), np.arange(z.shape[0])[:, None]
        return np.stack([(u - self.cx) * z / self.fx, (v - self.cy) * z / self.fy, z], axis=-1), valid


NYU_CAMERA = Pinhole(fx=518.857901, fy=519.469611, cx=325.582245, cy=253.736166)
"""Colour camera of NYU Depth V2, from its toolbox; its depth images are registered to it."""


def valid_depths(depth_m: ArrayLike, max_depth: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return a depth image with NaN where it is not valid, and where it is; see `Pinhole.back_project`."""
    with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN like any other
        depth = np.asarray(depth_m, dtype=np.float64)
    if depth.ndim != 2:
        raise InputError(f"a depth image must have shape (H, W), not {depth.shape}.")
    valid = np.isfinite(depth) & (depth > 0) & (depth <= max_depth)
    return np.where(valid, depth, np.nan), valid


def cloud_from_depth(
    depth_m: ArrayLike,
    camera: Camera,
    classes: Classes,
    labels: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    colours: ArrayLike | None = None,
    T_world_sensor: ArrayLike | None = None,
    max_depth: float = 10.0,
    up: Up | None = None,
) -> LabelledCloud:
    """Return the cloud of the valid pixels of an RGB-D frame, row by row.

    Parameters
    ----------
    depth_m : (H, W) array
        Depth in metres; pixels without a valid one (see `Pinhole.back_project`) are left out.
    camera : Pinhole or DistortedCamera
        The camera to which all images are registered.
    classes : Classes
        The classes that the labels speak of.
    labels : (H, W) integer array, optional
        Hard labels, -1 where missing.
    weights : (H, W, C) array, optional
        Soft labels instead.
    colours : (H, W, 3) uint8 array, optional
        Red, green, blue.
    T_world_sensor : (4, 4) array, optional
        Pose of the camera's optical frame in the world. Left out, the camera's frame is the world.
    max_depth : float
        Depths beyond it, in metres, are left out.
    up : str, optional
        The axis of the world that points upwards. Left out, "z", or "-y" where the camera's frame is the world.

    Raises
    ------
    InputError
        Images whose sizes differ from the depth's, or whatever `LabelledCloud` refuses.
    """
    points, valid = camera.back_project(depth_m, max_depth)
    pose = np.eye(4) if T_world_sensor is None else np.asarray(T_world_sensor, dtype=np.float64)
    if pose.shape != (4, 4):
        raise InputError(f"T_world_sensor must have shape (4, 4), not {pose.shape}.")

    def at_valid(name: str, image: ArrayLike | None) -> Any:
        if image is None:
            return None
        image = np.asarray(image)
        if image.shape[:2] != valid.shape:
            raise InputError(
                f"{name} must be an image of {valid.shape[0]} x {valid.shape[1]} pixels like the depth, "
                f"not of shape {image.shape}."
            )
        return image[valid]

    rows, columns = valid.shape
    return LabelledCloud(
        points=points[valid] @ pose[:3, :3].T + pose[:3, 3],
        classes=classes,
        labels=at_valid("labels", labels),
        weights=at_valid("weights", weights),
        colours=at_valid("colours", colours),
        T_world_sensor=pose,
        pixels=np.argwhere(valid).astype(np.int32),
        image_shape=(rows, columns),
        up=up or ("-y" if T_world_sensor is None else "z"),
    )
