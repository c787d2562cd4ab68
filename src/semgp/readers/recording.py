"""What a recording of an RGB-D camera holds: frames that are not yet read, and its intrinsics."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.camera import Pinhole
from semgp.errors import FileFormatError


class SkippedFramesWarning(UserWarning):
    """Frames of a recording are left out because nobody knows where they were taken."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of a recording, not yet read.

    Parameters
    ----------
    colour, depth : Path
        Its images.
    T_world_sensor : (4, 4) array, optional
        Pose of the camera's optical frame; None where tracking was lost.
    stamp : float, optional
        When it was taken, seconds.
    """

    colour: Path
    depth: Path
    T_world_sensor: NDArray[np.float64] | None
    stamp: float | None = None


@dataclass(frozen=True)
class Recording:
    """What a folder of some layout holds.

    Parameters
    ----------
    frames : tuple of Frame
        All frames in order, those without a pose, too.
    camera : Pinhole
        Intrinsics of the depth images.
    colour_camera : Pinhole, optional
        Intrinsics of the colour images, where those are not registered to the depth pixel by pixel.
    units_per_metre : float
        What a depth image counts.
    """

    frames: tuple[Frame, ...]
    camera: Pinhole
    colour_camera: Pinhole | None = None
    units_per_metre: float = 1000.0


def with_poses(path: Path, frames: tuple[Frame, ...]) -> tuple[tuple[Frame, ...], tuple[str, ...]]:
    """Return the frames that have a pose, and the names of the others, after a warning."""
    kept = tuple(frame for frame in frames if frame.T_world_sensor is not None)
    skipped = tuple(frame.colour.name for frame in frames if frame.T_world_sensor is None)
    if not kept:
        raise FileFormatError(path, f"has {len(frames)} frames, none of them with a valid pose.")
    if skipped:
        warnings.warn(
            f"{path}: {len(skipped)} of {len(frames)} frames have no valid pose and are left out, "
            f"the first of them {skipped[0]}.",
            SkippedFramesWarning,
            stacklevel=2,
        )
    return kept, skipped
