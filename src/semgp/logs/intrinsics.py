"""The camera of a log's images."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.camera import Camera, Pinhole
from semgp.distortion import DistortedCamera
from semgp.errors import InputError
from semgp.lenses import lens_of

TRANSPORTS = ("/compressed", "/compressedDepth")
"""What image_transport appends to the topic of the images that it compresses."""


def is_raw(topic: str) -> bool:
    """Tell from a topic's name whether its images are as the camera took them: `image_raw`, compressed or not."""
    for transport in TRANSPORTS:
        topic = topic.removesuffix(transport)
    return topic.endswith("image_raw")


def camera_of(message: Any, *, raw: bool) -> Camera:
    """Return the camera of a sensor_msgs/CameraInfo.

    Its K and D speak of raw images, its P of rectified ones. Where nothing is distorted the two are one, and P is
    taken; where P is all zeros, which means an uncalibrated or plain camera, K.

    Parameters
    ----------
    message : CameraInfo
        The message.
    raw : bool
        Whether the images are raw.

    Raises
    ------
    InputError
        Images that are binned or cut out, matrices that are none of a camera, or a lens that is not known.
    """
    if max(message.binning_x, message.binning_y) > 1 or message.roi.width or message.roi.height:
        raise InputError("its camera info speaks of binned or cut-out images, which are not supported.")
    D, K, P = (_numbers(message, name) for name in "dkp")
    if raw and D.any():
        return DistortedCamera(_pinhole(K[[0, 4, 2, 5]]), lens_of(message.distortion_model, D.tolist()))
    return _pinhole(P[[0, 5, 2, 6]] if P.any() else K[[0, 4, 2, 5]])


def _numbers(message: Any, name: str) -> NDArray[np.float64]:
    """Return a matrix of a CameraInfo; ROS 1 writes its name in capitals."""
    found = getattr(message, name) if hasattr(message, name) else getattr(message, name.upper())
    return np.asarray(found, dtype=np.float64)


def _pinhole(numbers: NDArray[np.float64]) -> Pinhole:
    fx, fy, cx, cy = numbers.tolist()
    return Pinhole(fx, fy, cx, cy)
