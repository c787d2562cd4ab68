"""Making messages: of the classes of rosbags, for bags, or of those of a user's ROS 2."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.logs.definitions import LABEL_INFO, OCTOMAP, POINTS, TF, typestore
from semgp.logs.frames import NS
from semgp.logs.pointcloud2 import content_of, packed
from semgp.logs.rigid import quaternion
from semgp.picture.colour import by_class
from semgp.prediction import Prediction
from semgp.writers.columns import Columns, coordinates, number_column, probability_columns, require_different


@dataclass(frozen=True)
class Messages:
    """Makes messages.

    Parameters
    ----------
    kinds : callable
        Returns the class of a type such as "std_msgs/msg/Header"; its instances take their fields by keyword.
    ros1 : bool
        Headers have a sequence number.
    bytes_of : callable
        Turns an array of 8-bit numbers into what the classes keep such numbers in.
    """

    kinds: Callable[[str], Callable[..., Any]]
    ros1: bool = False
    bytes_of: Callable[[NDArray[Any]], Any] = np.asarray

    def header(self, frame: str, stamp: int) -> Any:
        """Return a std_msgs/Header; the stamp in nanoseconds."""
        time = self.kinds("builtin_interfaces/msg/Time")(sec=stamp // NS, nanosec=stamp % NS)
        sequence = {"seq": 0} if self.ros1 else {}
        return self.kinds("std_msgs/msg/Header")(**sequence, stamp=time, frame_id=frame)

    def points(self, frame: str, stamp: int, columns: Mapping[str, NDArray[Any]]) -> Any:
        """Return a sensor_msgs/PointCloud2 of columns (N,)."""
        content = content_of(columns)
        fields = [
            self.kinds("sensor_msgs/msg/PointField")(name=name, offset=offset, datatype=datatype, count=count)
            for name, offset, datatype, count in content.pop("fields")
        ]
        data = self.bytes_of(content.pop("data"))
        return self.kinds(POINTS)(header=self.header(frame, stamp), fields=fields, data=data, **content)

    def transforms(self, stamp: int, edges: Iterable[tuple[str, str, NDArray[np.float64]]]) -> Any:
        """Return a tf2_msgs/TFMessage of edges: parent, child and `T_parent_child` (4, 4)."""
        return self.kinds(TF)(transforms=[self._transform(stamp, *edge) for edge in edges])

    def _transform(self, stamp: int, parent: str, child: str, T: NDArray[np.float64]) -> Any:
        geometry = "geometry_msgs/msg/"
        x, y, z, w = quaternion(T[:3, :3]).tolist()
        rotation = self.kinds(geometry + "Quaternion")(x=x, y=y, z=z, w=w)
        x, y, z = T[:3, 3].tolist()
        translation = self.kinds(geometry + "Vector3")(x=x, y=y, z=z)
        return self.kinds(geometry + "TransformStamped")(
            header=self.header(parent, stamp),
            child_frame_id=child,
            transform=self.kinds(geometry + "Transform")(translation=translation, rotation=rotation),
        )

    def label_info(self, frame: str, stamp: int, classes: Classes) -> Any:
        """Return a vision_msgs/LabelInfo, which names the classes."""
        named = [
            self.kinds("vision_msgs/msg/VisionClass")(class_id=label, class_name=name)
            for label, name in enumerate(classes.names)
        ]
        return self.kinds(LABEL_INFO)(header=self.header(frame, stamp), class_map=named, threshold=0.0)

    def octomap(self, frame: str, stamp: int, tree: bytes) -> Any:
        """Return an octomap_msgs/Octomap of the content of a `.bt` file.

        `data` is what follows the file's header, which is what the conversions of octomap_msgs read and write
        (`writeBinaryData`, `readBinaryData`): the header's id and resolution are fields of the message.
        """
        header, _, body = tree.partition(b"\ndata\n")
        facts = dict(line.split(None, 1) for line in header.decode("ascii").splitlines() if line[0] != "#")
        return self.kinds(OCTOMAP)(
            header=self.header(frame, stamp),
            binary=True,
            id=facts["id"],
            resolution=float(facts["res"]),
            data=self.bytes_of(np.frombuffer(body, dtype=np.int8)),
        )


def of_rosbags(*, ros1: bool) -> Messages:
    """Return what makes messages of the classes of rosbags.

    Raises
    ------
    MissingExtraError
        rosbags is not installed.
    """
    types = typestore(ros1=ros1).types
    return Messages(lambda name: types[name], ros1)


def of_ros2() -> Messages:
    """Return what makes messages of the classes of the ROS 2 that is sourced."""

    def kind(name: str) -> Any:
        package, folder, title = name.split("/")
        try:
            return getattr(import_module(f"{package}.{folder}"), title)
        except ImportError as error:
            raise InputError(
                f"the ROS 2 package {package} cannot be imported ({error}): install it and source its setup.bash."
            ) from error

    return Messages(kind, bytes_of=lambda a: array("b" if a.dtype == np.int8 else "B", a.tobytes()))


def prediction_columns(points: NDArray[np.float64], prediction: Prediction) -> dict[str, NDArray[Any]]:
    """Return the columns of a prediction at points (N, 3).

    x, y, z, rgb (the class's colour), label (-1 where nothing was observed), confidence, entropy, variance of the
    most probable class, occupancy and state (1 occupied, 0 free, -1 unknown) where the map has them, and
    `p_<class name>` for each class.

    Raises
    ------
    InputError
        Points of another number than the prediction's.
    """
    n, label = len(prediction), prediction.label
    if len(points) != n:
        raise InputError(f"{len(points)} points but a prediction of {n}.")
    numbers: Columns = [
        ("label", label),
        ("confidence", prediction.confidence),
        ("entropy", prediction.entropy),
    ]
    if prediction.variance is not None:
        best = prediction.probability.argmax(axis=1)[:, None]
        numbers.append(("variance", np.take_along_axis(prediction.variance, best, axis=1)[:, 0]))
    if prediction.occupancy is not None:
        numbers += [("occupancy", prediction.occupancy.probability), ("state", prediction.occupancy.state)]
    return columns(
        points, by_class(label, prediction.classes), numbers, prediction.probability, prediction.classes
    )


def columns(
    points: NDArray[np.float64],
    colours: NDArray[np.uint8] | None,
    numbers: Columns,
    probability: NDArray[Any] | None,
    classes: Classes,
) -> dict[str, NDArray[Any]]:
    """Return the columns of a PointCloud2: coordinates, `rgb`, numbers by their names, then `p_<class name>`.

    Raises
    ------
    InputError
        Two columns of one name, a name that no field can have, or columns that are not as long as the points.
    """
    found = coordinates(points)
    if colours is not None:
        found.append(("rgb", packed(colours)))
    found += [(name, number_column(name, values, len(points))) for name, values in numbers]
    if probability is not None:
        found += probability_columns(probability, classes, len(points))
    require_different(found)
    return dict(found)
