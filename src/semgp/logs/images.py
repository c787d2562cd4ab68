"""Depth, label and colour images of a log: matched by their stamps, and made into a cloud."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.camera import Pinhole, cloud_from_depth
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.logs.bag import Bag, Place
from semgp.logs.definitions import CAMERA, IMAGE
from semgp.logs.frames import NS
from semgp.logs.poses import SensorPose
from semgp.readers.rgbd import MOST_PIXELS

DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")
LABEL_ENCODINGS = ("mono8", "8UC1", "mono16", "16UC1", "16SC1", "32SC1")
COLOUR_ENCODINGS = ("rgb8", "bgr8", "rgba8", "bgra8")

_PIXELS = {
    **dict.fromkeys(("mono8", "8UC1"), ("u1", 1)),
    **dict.fromkeys(("mono16", "16UC1"), ("u2", 1)),
    **{"16SC1": ("i2", 1), "32SC1": ("i4", 1), "32FC1": ("f4", 1)},
    **dict.fromkeys(("rgb8", "bgr8"), ("u1", 3)),
    **dict.fromkeys(("rgba8", "bgra8"), ("u1", 4)),
}


@dataclass(frozen=True)
class Images:
    """The frames of an RGB-D camera in a log; for the options see `open_log`.

    Depth is in millimetres where it is whole numbers, else in metres, as in ROS REP-118. Labels are raw ids where
    the classes have some, else class numbers, of which the largest of an unsigned type and negative ones are
    missing.

    Raises
    ------
    InputError
        No topic of label images or of sensor_msgs/CameraInfo, or topics of another type.
    """

    bag: Bag
    depth: str
    labels: str | None
    camera_info: str | None
    colour: str | None
    classes: Classes | None
    max_depth: float
    tolerance: float
    stride: int | None

    def __post_init__(self) -> None:
        if self.labels is None or self.camera_info is None:
            raise InputError(
                f"depth images need labels=... and camera_info=..., the topics of label images and of {CAMERA}; "
                f"{self.bag.listing()}"
            )
        for name in (self.depth, self.labels, self.colour):
            if name is not None:
                self.bag.require(name, IMAGE)
        self.bag.require(self.camera_info, CAMERA)

    def moments(self) -> tuple[list[tuple[Place, ...]], list[tuple[float, str]]]:
        """Return what is read together, and what cannot be read and why: see `Source`."""
        topics = (self.labels, self.camera_info, self.colour)
        others = [[] if name is None else list(self.bag.places(name)) for name in topics]
        stamps = [np.array([place.stamp for place in places], dtype=np.int64) for places in others]
        moments: list[tuple[Place, ...]] = []
        skipped = []
        for depth in self.bag.places(self.depth):
            near = [_nearest(s, depth.stamp, t) for s, t in zip(stamps, (self.tolerance, np.inf, self.tolerance))]
            if near[0] is None or near[1] is None:
                lacks = f"label image within {self.tolerance:g} s" if near[0] is None else "camera info"
                skipped.append((depth.stamp / NS, f"no {lacks} of the depth image."))
                continue
            moments.append((depth, *(places[k] for k, places in zip(near, others) if k is not None)))
        return moments, skipped

    def read(self, places: Sequence[Place], pose: SensorPose) -> LabelledCloud:
        """Read a depth image and what goes with it, and place the cloud in the world."""
        depth, labels, info, *colour = (self.bag.message(place) for place in places)
        Z = pixels_of(depth, "depth", DEPTH_ENCODINGS)
        L = _labels(pixels_of(labels, "label", LABEL_ENCODINGS), self.classes)
        if (info.height, info.width) != Z.shape:
            raise InputError(f"its camera info is of {info.height} x {info.width} pixels, not of {Z.shape}.")
        return cloud_from_depth(
            _thinned(Z / 1000 if Z.dtype.kind == "u" else Z, self.stride),
            camera_of(info),
            self.classes or Classes.numbered(int(L.max(initial=0)) + 1),
            labels=L,
            colours=_rgb(colour[0]) if colour else None,
            T_world_sensor=pose.T_world_frame,
            max_depth=self.max_depth,
        )


def pixels_of(message: Any, what: str, encodings: Sequence[str]) -> NDArray[Any]:
    """Return the pixels of a sensor_msgs/Image, (H, W) or (H, W, channels), in the machine's byte order.

    Raises
    ------
    InputError
        An encoding that is not among those given, or fewer bytes than pixels.
    """
    if message.encoding not in encodings:
        raise InputError(f"its {what} image is {message.encoding!r}, not one of {', '.join(encodings)}.")
    kind, channels = _PIXELS[message.encoding]
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width, step = int(message.height), int(message.width), int(message.step)
    size = dtype.itemsize
    if step < width * channels * size:
        raise InputError(f"its {what} image has rows of {step} bytes, too few for {width} pixels.")
    data = np.frombuffer(message.data, dtype=np.uint8)
    if len(data) < height * step:
        raise InputError(f"its {what} image has {len(data)} bytes where {height} rows need {height * step}.")
    if not (height and width):
        raise InputError(f"its {what} image has no pixels.")
    strides = (step, channels * size, size)
    view = np.ndarray((height, width, channels), dtype, data, strides=strides).astype(dtype.newbyteorder("="))
    return view[..., 0] if channels == 1 else view


def camera_of(message: Any) -> Pinhole:
    """Return the camera of a sensor_msgs/CameraInfo, by its matrix P, which speaks of rectified images.

    Where P is all zeros, which means an uncalibrated or plain camera, K is taken.

    Raises
    ------
    InputError
        Images that are binned or cut out, or matrices that are none of a camera.
    """
    P = np.asarray(message.p if hasattr(message, "p") else message.P, dtype=np.float64)
    K = np.asarray(message.k if hasattr(message, "k") else message.K, dtype=np.float64)
    if max(message.binning_x, message.binning_y) > 1 or message.roi.width or message.roi.height:
        raise InputError("its camera info speaks of binned or cut-out images, which are not supported.")
    fx, cx, fy, cy = P[[0, 2, 5, 6]] if P.any() else K[[0, 2, 4, 5]]
    return Pinhole(fx, fy, cx, cy)


def _thinned(depth: NDArray[np.floating], stride: int | None) -> NDArray[np.floating]:
    """Return a depth image with every stride-th pixel of every stride-th row, and no depth at the others."""
    step = stride or max(1, math.ceil(math.sqrt(depth.size / MOST_PIXELS)))
    if step < 1:
        raise InputError(f"stride must be a positive whole number, not {stride}.")
    kept = (slice(step // 2, None, step),) * 2
    thin = np.zeros_like(depth)
    thin[kept] = depth[kept]
    return thin


def _rgb(message: Any) -> NDArray[np.uint8]:
    pixels = pixels_of(message, "colour", COLOUR_ENCODINGS)[..., :3]
    return pixels[..., ::-1] if message.encoding.startswith("bgr") else pixels


def _labels(raw: NDArray[Any], classes: Classes | None) -> NDArray[np.int64]:
    if classes is not None and classes.ids:
        return classes.from_ids(raw)
    missing = raw == np.iinfo(raw.dtype).max if raw.dtype.kind == "u" else raw < 0
    return np.where(missing, MISSING, raw.astype(np.int64))


def _nearest(stamps: NDArray[np.int64], stamp: int, tolerance: float) -> int | None:
    """Return which of some stamps is nearest to one, at most `tolerance` seconds off; None where there is none."""
    if not len(stamps):
        return None
    found = int(np.abs(stamps - stamp).argmin())
    return found if abs(int(stamps[found]) - stamp) <= tolerance * NS else None
