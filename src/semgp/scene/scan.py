"""Scans of the synthetic room: what is there, and what a robot gets to see of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import atan2, cos, pi, radians, sin

import numpy as np
from numpy.typing import NDArray

from semgp.camera import cloud_from_depth
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.scene.furniture import Solid, Thing
from semgp.scene.labels import LabelFaults
from semgp.scene.raycast import Solids, cast
from semgp.scene.room import CLASSES, furnish
from semgp.scene.sensor import DepthCamera
from semgp.scene.shading import shade

_PATH = (2.3, 1.85, 1.5)
"""Semi-axes and height in metres of the ellipse on which the camera goes around the room."""
_FIRST_ANGLE, _LOOKING_DOWN = radians(-161), radians(8)


@dataclass(frozen=True, eq=False)
class SyntheticScan:
    """One view of the room. Row i of `truth` and of `observed` is the same pixel.

    Parameters
    ----------
    truth : LabelledCloud
        The pixels that the sensor answers for: exact points, true labels, colours, pixels and pose.
    observed : LabelledCloud
        The same pixels as the robot gets them: noisy points; labels sparse, missing and partly wrong.
    rgb : (H, W, 3) uint8 array
        Colour image.
    depth : (H, W) array
        Depth as measured, in metres; 0 where it is missing.
    depth_true : (H, W) array
        True depth in metres, everywhere.
    label : (H, W) int32 array
        True labels, everywhere.
    """

    truth: LabelledCloud
    observed: LabelledCloud
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float64]
    depth_true: NDArray[np.float64]
    label: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class SyntheticRoom:
    """A furnished room that a depth camera looks at from a path around its middle; see `synthetic_room`."""

    seed: int
    views: int
    camera: DepthCamera
    faults: LabelFaults

    def __post_init__(self) -> None:
        if self.seed < 0 or self.views < 1:
            raise InputError("seed must not be negative, and a room needs at least one view.")

    @property
    def classes(self) -> Classes:
        """The classes of the room."""
        return CLASSES

    @cached_property
    def things(self) -> list[Thing]:
        """The objects of the room."""
        return furnish(self.seed)

    @cached_property
    def solids(self) -> Solids:
        """All solids of all objects, in the order of `things`."""
        parts = self._parts
        return Solids(
            np.array([p.shape for p in parts]),
            np.array([p.centre for p in parts]),
            np.array([p.half for p in parts]),
            np.array([p.yaw for p in parts]),
        )

    def pose(self, view: int) -> NDArray[np.float64]:
        """Return `T_world_sensor` (4, 4) of a view: optical frame, x right, y down, z forward.

        Raises
        ------
        InputError
            A view that does not exist.
        """
        if not 0 <= view < self.views:
            raise InputError(f"view must lie between 0 and {self.views - 1}, not {view}.")
        angle = 2 * pi * view / self.views + _FIRST_ANGLE
        eye = np.array([_PATH[0] * cos(angle), _PATH[1] * sin(angle), _PATH[2]])
        heading, pitch = atan2(-eye[1], -eye[0]), _LOOKING_DOWN
        T = np.eye(4)
        T[:3, 0] = sin(heading), -cos(heading), 0
        T[:3, 1] = -cos(heading) * sin(pitch), -sin(heading) * sin(pitch), -cos(pitch)
        T[:3, 2] = cos(heading) * cos(pitch), sin(heading) * cos(pitch), -sin(pitch)
        T[:3, 3] = eye
        return T

    def scan(self, view: int = 0) -> SyntheticScan:
        """Return what the camera sees from a view, the same at every call."""
        T = self.pose(view)
        rng = np.random.default_rng((self.seed, view))
        shape = (self.camera.height, self.camera.width)
        rays = self.camera.rays.reshape(-1, 3) @ T[:3, :3].T
        hits = cast(self.solids, T[:3, 3], rays)
        points = T[:3, 3] + hits.distance[:, None] * rays
        cosine = -(hits.normal * rays).sum(axis=1) / np.linalg.norm(rays, axis=1)
        depth_true, thing = hits.distance.reshape(shape), self._thing[hits.solid].reshape(shape)
        depth = self.camera.measure(depth_true, cosine.reshape(shape), rng)
        label = self._label[thing]
        given = self.faults.apply(label, len(CLASSES), rng)
        given[np.isin(thing, self._unlabelled)] = MISSING
        rgb = shade(self.solids, points, hits.normal, self._paint[hits.solid]).reshape(*shape, 3)

        def cloud(depth: NDArray[np.float64], labels: NDArray[np.int32]) -> LabelledCloud:
            return cloud_from_depth(
                depth, self.camera.pinhole, CLASSES, labels=labels, colours=rgb, T_world_sensor=T
            )

        return SyntheticScan(
            truth=cloud(np.where(depth > 0, depth_true, 0), label),
            observed=cloud(depth, given),
            rgb=rgb,
            depth=depth,
            depth_true=depth_true,
            label=label,
        )

    @cached_property
    def _parts(self) -> list[Solid]:
        return [solid for thing in self.things for solid in thing.solids]

    @cached_property
    def _paint(self) -> NDArray[np.uint8]:
        return np.array([p.colour for p in self._parts], dtype=np.uint8)

    @cached_property
    def _thing(self) -> NDArray[np.int64]:
        return np.repeat(np.arange(len(self.things)), [len(thing.solids) for thing in self.things])

    @cached_property
    def _label(self) -> NDArray[np.int32]:
        return np.array([CLASSES.index(thing.name) for thing in self.things], dtype=np.int32)

    @cached_property
    def _unlabelled(self) -> NDArray[np.int64]:
        """Return the objects that no view labels."""
        names = [thing.name for thing in self.things]
        one_of_many = [i for i, name in enumerate(names) if names.count(name) > 1]
        return np.random.default_rng(self.seed).permutation(one_of_many)[: self.faults.unlabelled]


def synthetic_room(
    seed: int = 0,
    views: int = 24,
    camera: DepthCamera | None = None,
    faults: LabelFaults | None = None,
) -> SyntheticRoom:
    """Return a furnished room of thirteen classes that is scanned by ray casting.

    Parameters
    ----------
    seed : int
        Decides furniture, sensor noise and label faults. The same seed gives the same scans.
    views : int
        Number of camera poses, evenly spaced on the path around the room.
    camera : DepthCamera, optional
        The sensor; 320 x 240 pixels if left out.
    faults : LabelFaults, optional
        What is wrong with the observed labels.
    """
    return SyntheticRoom(seed, views, camera or DepthCamera(), faults or LabelFaults())
