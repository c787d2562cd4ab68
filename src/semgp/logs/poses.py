"""Where the sensor was: poses from tf, or from a topic of odometry or poses with tf for the rest of the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import FileFormatError, InputError
from semgp.logs.bag import Bag
from semgp.logs.definitions import ODOMETRY, POSE, POSE_WITH_COVARIANCE, TF
from semgp.logs.frames import Frames, Track, bare, stamp_of
from semgp.logs.rigid import row_of


@dataclass(frozen=True)
class SensorPose:
    """Where a sensor was.

    Parameters
    ----------
    T_world_frame : (4, 4) array
        Pose of the frame that its data are in.
    known : bool
        Whether the sensor sits at that frame's origin. Not so where the frame is the world itself, or where
        nothing in tf moves it and nobody says that it stood still: the data have a place, but where they were seen
        from is not known.
    covariance : (6, 6) array, optional
        As `LabelledCloud.pose_covariance`.
    """

    T_world_frame: NDArray[np.float64]
    known: bool = True
    covariance: NDArray[np.float64] | None = None

    @property
    def T_world_sensor(self) -> NDArray[np.float64] | None:
        """Pose (4, 4) of the sensor, where it is known."""
        return self.T_world_frame if self.known else None


def frames_of(bag: Bag, max_gap: float) -> Frames:
    """Return the frames of all /tf and /tf_static topics of a bag, whatever namespace they are in."""
    frames = Frames(max_gap)
    for topic in bag.topics_of(TF, "tf/msg/tfMessage"):
        for message in bag.messages(topic.name):
            frames.add(message, fixed=topic.name.endswith("tf_static"))
    return frames


class Odometry:
    """Poses of one frame in another, with covariances, from a topic.

    nav_msgs/Odometry says which frame its pose is of (`child_frame_id`); geometry_msgs/PoseStamped and
    PoseWithCovarianceStamped do not.

    Parameters
    ----------
    bag : Bag
        The bag.
    topic : str
        The topic.
    pose_frame : str, optional
        The frame that the poses are of, instead of what the messages say.
    max_gap : float
        As in `Frames`.

    Raises
    ------
    InputError
        No such topic, or one of another type; poses of a frame that nobody names.
    FileFormatError
        No usable pose, or poses of several frames.
    """

    def __init__(self, bag: Bag, topic: str, pose_frame: str | None, max_gap: float) -> None:
        bag.require(topic, ODOMETRY, POSE, POSE_WITH_COVARIANCE)
        self.topic, self.max_gap = topic, max_gap
        self._track = Track()
        self._covariances: dict[int, NDArray[np.float64] | None] = {}
        named: set[tuple[str, str]] = set()
        for message in bag.messages(topic):
            row = _row(message)
            if row is None:
                continue
            stamp = stamp_of(message.header)
            self._track.add(stamp, row)
            self._covariances[stamp] = _covariance(message)
            named.add((bare(message.header.frame_id), pose_frame or bare(getattr(message, "child_frame_id", ""))))
        if len(named) != 1:
            raise FileFormatError(
                bag.path, f"{topic} holds {'no pose' if not named else 'poses of several frames'}."
            )
        self.parent, self.child = named.pop()
        if not self.child:
            raise InputError(
                f"{bag.path}: {topic} does not say which frame its poses are of: give it as pose_frame, "
                "for example pose_frame='base_link'."
            )

    def at(self, stamp: int) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """Return `T_parent_child` (4, 4) at a moment, and its covariance (6, 6) along the parent's axes.

        Raises
        ------
        NoTransformError
            A moment that the topic says nothing of.
        """
        what = f"{self.child!r} in {self.parent!r} ({self.topic})"
        before, after, share = self._track.around(stamp, self.max_gap, what)
        stamps, _ = self._track.in_order()
        a, b = (self._covariances[int(stamps[i])] for i in (before, after))
        covariance = None if a is None or b is None else (1 - share) * a + share * b
        return self._track.at(stamp, self.max_gap, what), covariance


@dataclass(frozen=True)
class Poses:
    """Where the sensors of a bag were, in one fixed frame.

    Parameters
    ----------
    frames : Frames
        What tf says.
    world : str, optional
        The fixed frame. Left out, it is the root of tf above the sensor, or the frame that the odometry is in.
    odometry : Odometry, optional
        Where the moving part of the chain comes from, instead of tf.
    """

    frames: Frames
    world: str | None = None
    odometry: Odometry | None = None

    def of(self, sensor: str, stamp: int) -> SensorPose:
        """Return where a sensor's frame was at a moment in nanoseconds.

        Raises
        ------
        NoTransformError
            Frames that are not connected, or not at that moment.
        """
        if self.odometry is not None:
            return self._by_odometry(self.odometry, sensor, stamp)
        world = self.frames.root(sensor) if self.world is None else self.world
        known = world != sensor and (self.world is not None or self.frames.moves(sensor))
        return SensorPose(self.frames.lookup(world, sensor, stamp), known)

    def _by_odometry(self, odometry: Odometry, sensor: str, stamp: int) -> SensorPose:
        T_parent_child, covariance = odometry.at(stamp)
        T_child_sensor = self.frames.lookup(odometry.child, sensor, stamp)
        world = odometry.parent if self.world is None else self.world
        T_world_parent = self.frames.lookup(world, odometry.parent, stamp)
        T_world_sensor = T_world_parent @ T_parent_child @ T_child_sensor
        if covariance is not None:
            lever = T_parent_child[:3, :3] @ T_child_sensor[:3, 3]
            covariance = moved_covariance(covariance, lever, T_world_parent[:3, :3])
        return SensorPose(T_world_sensor, covariance=covariance)


def moved_covariance(
    covariance: NDArray[np.float64], lever: NDArray[np.float64], R: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the covariance (6, 6) of a sensor's pose from that of the body which carries it.

    A small turn dr of the body moves a sensor at a lever arm a by dr x a; R turns the axes of the body's parent
    frame, along which the covariance and the lever are given, to the world's.
    """
    x, y, z = lever
    J = np.eye(6)
    J[:3, 3:] = ((0, z, -y), (-z, 0, x), (y, -x, 0))
    J = np.kron(np.eye(2), R) @ J
    return np.asarray(J @ covariance @ J.T)


def _row(message: Any) -> NDArray[np.float64] | None:
    pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
    return row_of(pose.position, pose.orientation)


def _covariance(message: Any) -> NDArray[np.float64] | None:
    """Return a pose's covariance (6, 6); None where there is none: all zeros, or a first entry below 0."""
    if not hasattr(message.pose, "covariance"):
        return None
    S = np.asarray(message.pose.covariance, dtype=np.float64).reshape(6, 6)
    return None if not S.any() or S[0, 0] < 0 else S
