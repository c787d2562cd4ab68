"""Depth, label and colour images of a log: matched by their stamps, and made into a cloud."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.camera import cloud_from_depth
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.logs.bag import Bag, Place
from semgp.logs.definitions import CAMERA, COMPRESSED, IMAGE
from semgp.logs.frames import NS
from semgp.logs.intrinsics import camera_of, is_raw
from semgp.logs.pixels import colours_of, depth_of, labels_of
from semgp.logs.poses import SensorPose
from semgp.readers.rgbd import MOST_PIXELS


@dataclass(frozen=True)
class Images:
    """The frames of an RGB-D camera in a log; for the options see `open_log`.

    All images are registered to the depth images. Whether these are raw or rectified says their topic's name.

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
                self.bag.require(name, IMAGE, COMPRESSED)
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
        Z, L = depth_of(depth), labels_of(labels, self.classes)
        if (info.height, info.width) != Z.shape:
            raise InputError(f"its camera info is of {info.height} x {info.width} pixels, not of {Z.shape}.")
        return cloud_from_depth(
            _thinned(Z, self.stride),
            camera_of(info, raw=is_raw(self.depth)),
            self.classes or Classes.numbered(int(L.max(initial=0)) + 1),
            labels=L,
            colours=colours_of(colour[0]) if colour else None,
            T_world_sensor=pose.T_world_frame,
            max_depth=self.max_depth,
        )


def _thinned(depth: NDArray[np.floating], stride: int | None) -> NDArray[np.floating]:
    """Return a depth image with every stride-th pixel of every stride-th row, and no depth at the others."""
    step = stride or max(1, math.ceil(math.sqrt(depth.size / MOST_PIXELS)))
    if step < 1:
        raise InputError(f"stride must be a positive whole number, not {stride}.")
    kept = (slice(step // 2, None, step),) * 2
    thin = np.zeros_like(depth)
    thin[kept] = depth[kept]
    return thin


def _nearest(stamps: NDArray[np.int64], stamp: int, tolerance: float) -> int | None:
    """Return which of some stamps is nearest to one, at most `tolerance` seconds off; None where there is none."""
    if not len(stamps):
        return None
    found = int(np.abs(stamps - stamp).argmin())
    return found if abs(int(stamps[found]) - stamp) <= tolerance * NS else None
