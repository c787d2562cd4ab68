"""Writing bags: ROS 2 (MCAP or sqlite3) and ROS 1, clouds and predictions with the frames that they are in."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError, MissingExtraError
from semgp.logs.definitions import LABEL_INFO, OCTOMAP, POINTS, TF, typestore
from semgp.logs.frames import NS
from semgp.logs.messages import columns, of_rosbags, prediction_columns
from semgp.logs.rigid import quaternion, transform
from semgp.prediction import Prediction
from semgp.writers.columns import LARGEST_ROUNDING, Columns

BEGIN = NS
"""Stamp in nanoseconds of what has none: one second, because ROS takes 0 for "the latest"."""

STEP = NS // 10
"""Nanoseconds between clouds that have no stamps."""


class Recording:
    """A bag that is being written; `recording` opens one.

    Everything is in one fixed frame. A prediction at points that float32 would move by more than
    `LARGEST_ROUNDING` metres in it, such as UTM coordinates, is given in a frame near by, whose place is in
    /tf_static: RViz draws in float32. Clouds far away that have no pose are given in float64.
    """

    def __init__(self, writer: Any, frame: str, *, ros1: bool) -> None:
        self._writer, self._frame, self._ros1 = writer, frame, ros1
        self._messages = of_rosbags(ros1=ros1)
        self._types = typestore(ros1=ros1)
        self._connections: dict[str, Any] = {}
        self._origins: dict[str, NDArray[np.float64]] = {}
        self._classes: Classes | None = None
        self._last = BEGIN - STEP

    def cloud(self, cloud: LabelledCloud, topic: str = "/points", sensor: str = "sensor") -> None:
        """Write a cloud: in its sensor's frame with the pose in /tf, or in the fixed frame where it has no pose.

        Fields are x, y, z, rgb, the features, label (-1 where missing) and `p_<class name>` for soft labels. Times
        are the clouds' stamps, which must increase; clouds without one follow each other by a tenth of a second.

        Raises
        ------
        InputError
            Other classes than before, stamps that do not increase or that ROS cannot hold, or features that no
            field can be called.
        """
        if sensor == self._frame:
            raise InputError(f"the sensor's frame and the fixed frame must differ, not both be {sensor!r}.")
        stamp = self._next_stamp(cloud.stamp)
        self.classes(cloud.classes, stamp)
        points, frame = cloud.points, self._frame
        if cloud.T_world_sensor is not None:
            frame, T = sensor, _as_read(cloud.T_world_sensor)
            points = (points - T[:3, 3]) @ T[:3, :3]
            self._write("/tf", TF, stamp, self._messages.transforms(stamp, [(self._frame, sensor, T)]))
        numbers: Columns = [("label", cloud.hard_labels)]
        if cloud.features is not None:
            numbers += [(name.replace(" ", "_"), f) for name, f in zip(cloud.feature_names, cloud.features.T)]
        fields = columns(points, cloud.colours, numbers, cloud.weights, cloud.classes)
        self._write(topic, POINTS, stamp, self._messages.points(frame, stamp, fields))

    def prediction(self, points: ArrayLike, prediction: Prediction, topic: str = "/semantic_map") -> None:
        """Write what a map says at points (N, 3); see `prediction_columns` for the fields.

        Raises
        ------
        InputError
            Points that are not (N, 3) and finite, or not as many as the prediction has.
        """
        stamp = max(self._last, BEGIN)
        self.classes(prediction.classes, stamp)
        frame, near = self._near(topic, np.asarray(points, dtype=np.float64), stamp)
        fields = prediction_columns(near, prediction)
        self._write(topic, POINTS, stamp, self._messages.points(frame, stamp, fields), once=True)

    def octomap(self, tree: bytes, origin: ArrayLike = (0, 0, 0), topic: str = "/octomap") -> None:
        """Write the content of a `.bt` file as octomap_msgs/Octomap; its coordinates begin at an origin (3,)."""
        stamp = max(self._last, BEGIN)
        frame = self._frame_at(topic, np.asarray(origin, dtype=np.float64), stamp)
        self._write(topic, OCTOMAP, stamp, self._messages.octomap(frame, stamp, tree), once=True)

    def classes(self, classes: Classes, stamp: int = BEGIN) -> None:
        """Write the names of the classes, once, as vision_msgs/LabelInfo on /label_info; the reader finds them.

        Raises
        ------
        InputError
            Other classes than before: a bag has one list.
        """
        if self._classes is None:
            self._classes = classes
            message = self._messages.label_info(self._frame, stamp, classes)
            self._write("/label_info", LABEL_INFO, stamp, message, once=True)
        elif classes.names != self._classes.names:
            raise InputError("all that is written to a bag must have the same classes.")

    def _next_stamp(self, seconds: float | None) -> int:
        stamp = self._last + STEP if seconds is None else round(seconds * NS)
        if not self._last < stamp < 2**31 * NS or stamp < 0:
            raise InputError(f"a cloud's stamp of {stamp / NS} s is not after the last, or not of ROS' time.")
        self._last = stamp
        return stamp

    def _near(self, topic: str, points: NDArray[np.float64], stamp: int) -> tuple[str, NDArray[np.float64]]:
        """Return the frame in which float32 holds the points of a topic, and the points in it."""
        far = topic in self._origins or np.abs(points).max(initial=0) * 2.0**-24 > LARGEST_ROUNDING / 2
        if not far:
            return self._frame, points
        middle = self._origins.get(topic, np.round((points.min(axis=0) + points.max(axis=0)) / 2))
        return self._frame_at(topic, middle, stamp), points - middle

    def _frame_at(self, topic: str, origin: NDArray[np.float64], stamp: int) -> str:
        """Return the topic's own frame, told in /tf_static: the fixed frame's axes, and an origin (3,) in it."""
        if not origin.any():
            return self._frame
        child = self._frame + topic.replace("/", "_")
        if topic not in self._origins:
            T = np.eye(4)
            T[:3, 3] = self._origins[topic] = origin
            message = self._messages.transforms(stamp, [(self._frame, child, T)])
            self._write("/tf_static", TF, stamp, message, once=True)
        return child

    def _write(self, topic: str, kind: str, stamp: int, message: Any, *, once: bool = False) -> None:
        """Write a message; topics that speak once only are kept for those who listen later."""
        if topic not in self._connections:
            quality = _ros1_quality(once) if self._ros1 else _ros2_quality(once)
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self._types, **quality)
        serialise = self._types.serialize_ros1 if self._ros1 else self._types.serialize_cdr
        self._writer.write(self._connections[topic], stamp, serialise(message, kind))


@contextmanager
def recording(path: str | Path, frame: str = "map", *, sqlite: bool = False) -> Iterator[Recording]:
    """Open a bag for writing; it is there, whole, once the block has ended well.

    Parameters
    ----------
    path : str or Path
        `*.bag` for ROS 1; `*.mcap` or `*.db3` for one file of ROS 2; any other name for a folder with
        `metadata.yaml`, as `ros2 bag` makes it. Files are replaced, folders are not.
    frame : str
        The fixed frame that everything is in.
    sqlite : bool
        Keep a folder's messages in sqlite3 instead of MCAP.

    Raises
    ------
    InputError
        A folder that exists already, or one to write into that does not.
    MissingExtraError
        rosbags is not installed: the extra `ros` brings it.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"cannot write {path}: the folder {path.parent} does not exist.")
    if path.is_dir():
        raise InputError(f"{path} exists already: a bag that is a folder is not replaced.")
    ros1 = path.suffix.lower() == ".bag"
    with TemporaryDirectory(dir=path.parent, prefix=f".{path.stem}-") as folder:
        inside = Path(folder) / (path.name if ros1 else path.stem)
        with _writer(inside, ros1, sqlite or path.suffix.lower() == ".db3") as writer:
            yield Recording(writer, frame, ros1=ros1)
        if path.suffix.lower() in (".mcap", ".db3"):
            inside = next(file for file in inside.iterdir() if file.suffix != ".yaml")
        inside.replace(path)


def write_clouds(path: str | Path, clouds: Iterable[LabelledCloud], **options: Any) -> None:
    """Write clouds one after the other as a bag; see `recording` for the options and `Recording.cloud`."""
    with recording(path, **options) as bag:
        for cloud in clouds:
            bag.cloud(cloud)


def _writer(path: Path, ros1: bool, sqlite: bool) -> Any:
    try:
        if ros1:
            from rosbags.rosbag1 import Writer as Writer1

            return Writer1(path)
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2
    except ImportError as error:
        raise MissingExtraError("reading and writing bags", "ros") from error
    return Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3 if sqlite else StoragePlugin.MCAP)


def _ros1_quality(latched: bool) -> dict[str, Any]:
    return {"latching": int(latched)}


def _ros2_quality(latched: bool) -> dict[str, Any]:
    """Return the quality of service of a topic: those that are said once are kept for who comes late."""
    from rosbags import interfaces as r

    never = r.QosTime(2147483647, 4294967295)
    quality = r.Qos(
        history=r.QosHistory.KEEP_LAST,
        depth=10,
        reliability=r.QosReliability.RELIABLE,
        durability=r.QosDurability.TRANSIENT_LOCAL if latched else r.QosDurability.VOLATILE,
        deadline=never,
        lifespan=never,
        liveliness=r.QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )
    return {"offered_qos_profiles": [quality]}


def _as_read(T: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a pose as it is after its rotation was written as a quaternion: points by it come back the same."""
    return transform(np.concatenate([T[:3, 3], quaternion(T[:3, :3])]))
