"""Definitions of the messages that bags hold: rosbags' standard ones, and those that it lacks."""

from __future__ import annotations

from functools import cache
from typing import Any

from semgp.errors import MissingExtraError

TF = "tf2_msgs/msg/TFMessage"
POINTS = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
CAMERA = "sensor_msgs/msg/CameraInfo"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
OCTOMAP = "octomap_msgs/msg/Octomap"
LABEL_INFO = "vision_msgs/msg/LabelInfo"

_FURTHER = {
    TF: "geometry_msgs/TransformStamped[] transforms",
    "tf/msg/tfMessage": "geometry_msgs/TransformStamped[] transforms",
    OCTOMAP: "std_msgs/Header header\nbool binary\nstring id\nfloat64 resolution\nint8[] data",
    "vision_msgs/msg/VisionClass": "uint16 class_id\nstring class_name",
    LABEL_INFO: "std_msgs/Header header\nvision_msgs/VisionClass[] class_map\nfloat32 threshold",
}


@cache
def typestore(*, ros1: bool) -> Any:
    """Return rosbags' store of the types of ROS 1 Noetic, or of ROS 2 Humble, with ours.

    Raises
    ------
    MissingExtraError
        rosbags is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise MissingExtraError("reading and writing bags", "ros") from error
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    for name, definition in _FURTHER.items():
        if name not in store.types:
            store.register(get_types_from_msg(definition, name))
    return store
