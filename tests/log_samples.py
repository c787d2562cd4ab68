"""Bags that tests write with rosbags alone, message by message: a robot with a lidar or a camera."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

STORAGES = ("run.mcap", "run.db3", "run.bag", "run_mcap", "run_sqlite3")
"""Names of bags, one a storage; the last two are folders."""

SIZES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


class RawBag:
    """Writes messages given as types and fields."""

    def __init__(self, writer: Any, ros1: bool) -> None:
        self.writer, self.ros1 = writer, ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        if ros1:
            tf = "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(tf, "tf2_msgs/msg/TFMessage"))
        self.connections: dict[str, Any] = {}

    def make(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def write(self, topic: str, message: Any, stamp: float) -> None:
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        serialise = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        self.writer.write(self.connections[topic], nanoseconds(stamp), serialise(message, kind))

    def header(self, frame: str, stamp: float) -> Any:
        whole = nanoseconds(stamp)
        time = self.make("builtin_interfaces/msg/Time", sec=whole // 10**9, nanosec=whole % 10**9)
        return self.make("std_msgs/msg/Header", **({"seq": 0} if self.ros1 else {}), stamp=time, frame_id=frame)

    def tf(self, parent: str, child: str, T: NDArray[np.float64], stamp: float, topic: str = "/tf") -> None:
        stamped = self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(parent, stamp),
            child_frame_id=child,
            transform=self.make(
                "geometry_msgs/msg/Transform",
                translation=self.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", T[:3, 3].tolist()))),
                rotation=self.quaternion(T),
            ),
        )
        self.write(topic, self.make("tf2_msgs/msg/TFMessage", transforms=[stamped]), stamp)

    def quaternion(self, T: NDArray[np.float64]) -> Any:
        q = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
        return self.make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", q)))

    def pose(self, T: NDArray[np.float64]) -> Any:
        position = self.make("geometry_msgs/msg/Point", **dict(zip("xyz", T[:3, 3].tolist())))
        return self.make("geometry_msgs/msg/Pose", position=position, orientation=self.quaternion(T))

    def odometry(
        self, frames: tuple[str, str], T: NDArray[np.float64], covariance: NDArray[np.float64], stamp: float
    ) -> None:
        vector = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        twist = self.make("geometry_msgs/msg/Twist", linear=vector, angular=vector)
        message = self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(frames[0], stamp),
            child_frame_id=frames[1],
            pose=self.make(
                "geometry_msgs/msg/PoseWithCovariance", pose=self.pose(T), covariance=covariance.ravel()
            ),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
        )
        self.write("/odom", message, stamp)

    def pose_with_covariance(
        self, frame: str, T: NDArray[np.float64], covariance: NDArray[np.float64], stamp: float
    ) -> None:
        both = {"pose": self.pose(T), "covariance": covariance.ravel()}
        message = self.make(
            "geometry_msgs/msg/PoseWithCovarianceStamped",
            header=self.header(frame, stamp),
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", **both),
        )
        self.write("/pose", message, stamp)

    def pose_stamped(self, frame: str, T: NDArray[np.float64], stamp: float) -> None:
        message = self.make("geometry_msgs/msg/PoseStamped", header=self.header(frame, stamp), pose=self.pose(T))
        self.write("/pose", message, stamp)

    def cloud(self, frame: str, stamp: float, rows: NDArray[np.void], topic: str = "/points") -> None:
        """Write the rows of a packed structured array of little-endian numbers."""
        numbers = {kind: number for number, kind in SIZES.items()}
        fields = [
            self.make(
                "sensor_msgs/msg/PointField",
                name=name,
                offset=rows.dtype.fields[name][1],  # type: ignore[index]
                datatype=numbers[rows.dtype[name].base.str[1:]],
                count=int(np.prod(rows.dtype[name].shape, dtype=int)),
            )
            for name in rows.dtype.names or ()
        ]
        message = self.make(
            "sensor_msgs/msg/PointCloud2",
            header=self.header(frame, stamp),
            height=1,
            width=len(rows),
            fields=fields,
            is_bigendian=False,
            point_step=rows.dtype.itemsize,
            row_step=rows.nbytes,
            data=np.frombuffer(rows.tobytes(), np.uint8),
            is_dense=True,
        )
        self.write(topic, message, stamp)

    def image(self, topic: str, frame: str, stamp: float, pixels: NDArray[Any], encoding: str) -> None:
        message = self.make(
            "sensor_msgs/msg/Image",
            header=self.header(frame, stamp),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=pixels.strides[0],
            data=np.frombuffer(pixels.tobytes(), np.uint8),
        )
        self.write(topic, message, stamp)

    def compressed(self, topic: str, frame: str, stamp: float, data: bytes, what: str) -> None:
        header = self.header(frame, stamp)
        content = np.frombuffer(data, np.uint8)
        message = self.make("sensor_msgs/msg/CompressedImage", header=header, format=what, data=content)
        self.write(topic, message, stamp)

    def camera_info(
        self,
        frame: str,
        stamp: float,
        K: NDArray[np.float64],
        shape: tuple[int, int],
        lens: tuple[str, Sequence[float]] = ("plumb_bob", (0,) * 5),
    ) -> None:
        P = np.hstack([K, np.zeros((3, 1))])
        matrices = {"d": np.array(lens[1], np.float64), "k": K.ravel(), "r": np.eye(3).ravel(), "p": P.ravel()}
        if self.ros1:
            matrices = {name.upper(): matrix for name, matrix in matrices.items()}
        roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        message = self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(frame, stamp),
            height=shape[0],
            width=shape[1],
            distortion_model=lens[0],
            **matrices,
            binning_x=0,
            binning_y=0,
            roi=self.make("sensor_msgs/msg/RegionOfInterest", **roi),
        )
        self.write("/camera_info", message, stamp)


@contextmanager
def raw_bag(path: Path) -> Iterator[RawBag]:
    """Open a bag of the storage that its name says (see `STORAGES`) for writing."""
    if path.suffix == ".bag":
        with Writer1(path) as one:
            yield RawBag(one, ros1=True)
        return
    plugin = StoragePlugin.SQLITE3 if "db3" in path.name or "sqlite" in path.name else StoragePlugin.MCAP
    folder = path.with_name("as_folder") if path.suffix else path
    with Writer2(folder, version=9, storage_plugin=plugin) as two:
        yield RawBag(two, ros1=False)
    if path.suffix:
        next(folder.glob(f"*{path.suffix}")).rename(path)


def nanoseconds(stamp: float) -> int:
    return round(stamp * 10**9)


def pose(x: float, y: float, z: float, *, yaw: float = 0.0, pitch: float = 0.0) -> NDArray[np.float64]:
    """Return a pose (4, 4); angles in radians."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZY", [yaw, pitch]).as_matrix()
    T[:3, 3] = x, y, z
    return T


def rows_of(points: NDArray[np.float64], labels: NDArray[Any]) -> NDArray[np.void]:
    """Return points and labels as a structured array x, y, z (float32), label (uint16; 65535 missing)."""
    rows = np.empty(len(points), dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("label", "<u2")])
    for axis, name in enumerate("xyz"):
        rows[name] = points[:, axis]
    rows["label"] = labels.astype(np.uint16)
    return rows


def message(**fields: Any) -> Any:
    """Return a message of no class at all."""
    return SimpleNamespace(**fields)
