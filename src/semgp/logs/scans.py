"""The scans of a log: labelled clouds with poses, each read when it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.logs.bag import Bag, Place
from semgp.logs.definitions import LABEL_INFO
from semgp.logs.frames import NS, NoTransformError, bare
from semgp.logs.poses import Poses, SensorPose
from semgp.readers.protocol import Scans


class Source(Protocol):
    """What the clouds of a log are made of."""

    def moments(self) -> tuple[Sequence[Sequence[Place]], list[tuple[float, str]]]:
        """Return the messages that are read together, and when (s) and why the others cannot be read.

        The first of a moment's messages has the stamp and the frame that count.
        """
        ...

    def read(self, places: Sequence[Place], pose: SensorPose) -> LabelledCloud:
        """Read the messages of a moment and place the cloud in the world.

        Raises
        ------
        InputError
            Messages that do not fit each other, or whose content is no labelled cloud.
        """
        ...


@dataclass(frozen=True)
class LogScans(Scans):
    """The scans of a log that have a pose, as a lazy sequence.

    Parameters
    ----------
    skipped : tuple of (float, str)
        The scans that are left out: when each was taken, in seconds, and why it is left out.
    """

    skipped: tuple[tuple[float, str], ...] = ()


def scans_of(bag: Bag, source: Source, poses: Poses, *, covariance: bool) -> LogScans:
    """Return the scans of a source that have a pose, each read when it is asked for.

    Raises
    ------
    InputError
        No scans, or none with a pose.
    """
    found, skipped = _with_poses(source, poses)
    if not found:
        raise _none_left(bag, skipped, poses)

    def scan_at(i: int) -> LabelledCloud:
        places, pose = found[i]
        first = places[0]
        try:
            cloud = source.read(places, pose)
            return replace(cloud, pose_covariance=pose.covariance if covariance else None, stamp=first.stamp / NS)
        except FileFormatError:
            raise
        except InputError as error:
            raise FileFormatError(bag.path, f"{first.topic} at {first.stamp / NS:.3f} s: {error}") from error

    return LogScans(range(len(found)), scan_at, tuple(skipped))


def _with_poses(
    source: Source, poses: Poses
) -> tuple[list[tuple[Sequence[Place], SensorPose]], list[tuple[float, str]]]:
    """Return the moments of a source that have a pose, with it, and the others with the reason why not."""
    moments, skipped = source.moments()
    found = []
    for places in moments:
        first = places[0]
        try:
            _require_way(poses, bare(first.frame), len(moments))
            found.append((places, poses.of(bare(first.frame), first.stamp)))
        except NoTransformError as error:
            skipped.append((first.stamp / NS, str(error)))
    return found, skipped


def _require_way(poses: Poses, sensor: str, n_scans: int) -> None:
    """Check that something moves the sensor of several scans, where the user does not say that it stood still."""
    if poses.odometry is None and poses.world is None and n_scans > 1 and not poses.frames.moves(sensor):
        root = poses.frames.root(sensor)
        raise NoTransformError(
            f"nothing in tf moves {sensor!r}: give frame={root!r} if it stood still, or the poses by odometry=..."
        )


def _none_left(bag: Bag, skipped: Sequence[tuple[float, str]], poses: Poses) -> InputError:
    if not skipped:
        return InputError(f"{bag.path} has no scans; {bag.listing()}")
    reasons = list(dict.fromkeys(why for _, why in skipped))
    known = ", ".join(poses.frames.names) or "no frames"
    return InputError(
        f"{bag.path}: none of {len(skipped)} scans can be used. The first: {reasons[0]} tf has {known}; "
        f"{bag.listing()}"
    )


def classes_in(bag: Bag) -> Classes | None:
    """Return the classes that a vision_msgs/LabelInfo of the bag names, None where none does, or not all."""
    for topic in bag.topics_of(LABEL_INFO):
        for message in bag.messages(topic.name):
            names = {int(c.class_id): c.class_name for c in message.class_map}
            if names and sorted(names) == list(range(len(names))):
                return Classes(tuple(names[c] for c in range(len(names))))
    return None
