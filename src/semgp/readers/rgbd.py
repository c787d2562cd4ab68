"""RGB-D recordings: colour and depth images with intrinsics and poses, one cloud a frame.

The layouts of folders are told apart and read in `semgp.readers.rgbd_layouts`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.camera import Pinhole
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.readers.images import read_colour_image, read_depth
from semgp.readers.label_folder import LabelFolder
from semgp.readers.protocol import Scans
from semgp.readers.recording import Frame, Recording, with_poses
from semgp.upward import up_of_cameras

MOST_PIXELS = 80_000
"""Where no stride is given, the smallest that leaves at most so many pixels of a depth image."""


class RGBDSequence:
    """The frames of a recording as labelled clouds, each read when it is asked for.

    A cloud has the points of every stride-th row and column of the depth image, with colours, `pixels` and
    `image_shape` of the colour image, `T_world_sensor` and, where the layout has it, `stamp`. Its `up` is what the
    cameras of all frames hold upwards on average: the world of many recordings is the first camera's frame.

    Frames whose pose is not finite, which is how trackers say that they were lost, are left out; a
    `SkippedFramesWarning` says how many, and `skipped` which.

    Parameters
    ----------
    path : Path
        The folder.
    recording : Recording
        What it holds.
    labels : str or Path, optional
        Folder of labels (see `semgp.readers.label_folder`), within the recording or elsewhere, for example from
        "semgp segment". Left out, the recording's own folder `labels`, where there is one.
    classes : Classes, optional
        What the labels mean, instead of the label folder's class file.
    soft : bool
        Take class probabilities, where the folder has them, rather than labels.
    camera : Pinhole, optional
        Intrinsics of the depth images instead of the recording's; colour must then be registered to depth.
    depth_scale : float, optional
        Units a metre of the depth images, instead of those of the layout (1000, or 5000 for TUM).
    max_depth : float
        Depths beyond it, in metres, are not believed.
    stride : int, optional
        Take every stride-th pixel of every stride-th row. Left out, the smallest that leaves `MOST_PIXELS`:
        2 for images of 640 x 480, which gives up to 76,800 points.

    Raises
    ------
    InputError
        Options out of range.
    FileFormatError
        No frame with a pose; when a frame is read: images that are missing, damaged or do not fit each other.
    """

    def __init__(
        self,
        path: Path,
        recording: Recording,
        *,
        labels: str | Path | None = None,
        classes: Classes | None = None,
        soft: bool = True,
        camera: Pinhole | None = None,
        depth_scale: float | None = None,
        max_depth: float = 10.0,
        stride: int | None = None,
    ) -> None:
        _require_positive("depth_scale", depth_scale)
        _require_positive("max_depth", max_depth)
        if stride is not None and (not isinstance(stride, int) or stride < 1):
            raise InputError(f"stride must be a whole number of pixels from 1 on, not {stride!r}.")
        self.path = Path(path)
        self.frames, self.skipped = with_poses(self.path, recording.frames)
        self.camera = camera or recording.camera
        self.colour_camera = None if camera else recording.colour_camera
        self.units_per_metre = depth_scale or recording.units_per_metre
        self.max_depth, self.stride, self.soft = max_depth, stride, soft
        self.classes = classes or Classes.numbered(1)
        self.labels = _label_folder(self.path, labels, classes)
        self.up = up_of_cameras([T for T in (frame.T_world_sensor for frame in self.frames) if T is not None])

    def __len__(self) -> int:
        return len(self.frames)

    def scan(self, i: int) -> LabelledCloud:
        """Read frame i, counted from 0 among those that have a pose.

        Raises
        ------
        FileFormatError
            Images that are missing, damaged or do not fit each other; labels likewise.
        """
        frame = self.frames[i]
        depth = read_depth(frame.depth, self.units_per_metre)
        colour = read_colour_image(frame.colour)
        points, valid = self.camera.back_project(depth, self.max_depth)
        kept = np.flatnonzero(valid & _every(valid.shape, self.stride))
        points = points.reshape(-1, 3)[kept]
        pixels = np.column_stack(np.unravel_index(kept, valid.shape)).astype(np.int32)
        if colour.shape[:2] != valid.shape:
            points, pixels = self._seen_in_colour(frame, points, colour.shape[:2])
        assert frame.T_world_sensor is not None
        T = frame.T_world_sensor
        rows, columns = colour.shape[:2]
        cloud = LabelledCloud(
            points=points @ T[:3, :3].T + T[:3, 3],
            classes=self.classes,
            colours=colour[pixels[:, 0], pixels[:, 1]],
            T_world_sensor=T,
            stamp=frame.stamp,
            pixels=pixels,
            image_shape=(rows, columns),
            up=self.up,
        )
        return cloud if self.labels is None else self.labels.labelled(cloud, frame.colour.stem, soft=self.soft)

    def _seen_in_colour(
        self, frame: Frame, points: NDArray[np.float64], shape: tuple[int, ...]
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Return the points that lie within the colour image, and their pixels there."""
        camera = self.colour_camera
        if camera is None:
            raise FileFormatError(
                frame.colour, f"is of {shape} pixels, {frame.depth.name} is not: register colour to depth first."
            )
        x, y, z = points.T
        pixels = np.column_stack([camera.fy * y / z + camera.cy, camera.fx * x / z + camera.cx]).round()
        inside = ((pixels >= 0) & (pixels < shape[:2])).all(axis=1)
        return points[inside], pixels[inside].astype(np.int32)


@dataclass(frozen=True)
class RGBDReader:
    """The registry's reader of one layout of RGB-D folders.

    Parameters
    ----------
    name, layout : str
        As in `semgp.readers.protocol.Reader`.
    is_one : callable
        Tells whether a folder has the layout.
    recording : callable
        Returns what a folder of the layout holds.
    """

    name: str
    layout: str
    is_one: Callable[[Path], bool] = field(repr=False)
    recording: Callable[[Path], Recording] = field(repr=False)

    def matches(self, path: Path) -> bool:
        """Tell whether the path is a folder of the layout."""
        return path.is_dir() and self.is_one(path)

    def scans(
        self,
        path: Path,
        *,
        labels: str | Path | None = None,
        classes: Classes | None = None,
        soft: bool = True,
        camera: Pinhole | None = None,
        depth_scale: float | None = None,
        max_depth: float = 10.0,
        stride: int | None = None,
    ) -> Scans:
        """Return the frames of a recording; see `RGBDSequence` for the options."""
        sequence = RGBDSequence(
            path,
            self.recording(path),
            labels=labels,
            classes=classes,
            soft=soft,
            camera=camera,
            depth_scale=depth_scale,
            max_depth=max_depth,
            stride=stride,
        )
        return Scans(range(len(sequence)), sequence.scan)


def _label_folder(path: Path, labels: str | Path | None, classes: Classes | None) -> LabelFolder | None:
    """Return the folder of labels: the recording's own, if it has one, or one by name, within it or elsewhere."""
    inside = path / (labels or "labels")
    if labels is None and not inside.is_dir():
        return None
    return LabelFolder(inside if inside.is_dir() else Path(labels or ""), classes)


def _every(shape: tuple[int, ...], stride: int | None) -> NDArray[np.bool_]:
    """Return the mask of every stride-th pixel of every stride-th row."""
    step = stride or max(1, math.ceil(math.sqrt(math.prod(shape) / MOST_PIXELS)))
    mask = np.zeros(shape, dtype=bool)
    mask[step // 2 :: step, step // 2 :: step] = True
    return mask


def _require_positive(name: str, value: float | None) -> None:
    if value is not None and not value > 0:
        raise InputError(f"{name} must be a positive number, not {value}.")
