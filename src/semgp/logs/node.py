"""A ROS 2 node that maps as the robot drives.

`LiveMap` is the node's logic and knows nothing of ROS 2 but the layout of its messages; `run` binds it to the
rclpy of the ROS 2 that is sourced. rclpy cannot be installed from PyPI: the binding has been tested against a
stand-in with its interfaces only, not against a running ROS 2.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.logs.clouds import cloud_of
from semgp.logs.definitions import OCTOMAP, POINTS, TF
from semgp.logs.frames import NS, Frames, NoTransformError, bare, stamp_of
from semgp.logs.maps import Answering, HasOctree, tree_of
from semgp.logs.messages import Messages, of_ros2, prediction_columns
from semgp.logs.poses import SensorPose


class Growing(Answering, Protocol):
    """A map that takes in clouds."""

    def update(self, cloud: LabelledCloud) -> None:
        """Take in a cloud."""
        ...

    def __len__(self) -> int:
        """Return the number of stored elements."""
        ...


@dataclass
class LiveMap:
    """A map that grows with the messages that come in.

    A cloud waits until tf has said where its sensor was at its stamp, but at most `patience` seconds of the
    clouds' own time; then it is given up. Poses are never guessed.

    Parameters
    ----------
    semantic_map : SemanticMap
        The map; None to begin one with the classes of the first cloud.
    begin : callable
        Makes an empty map of some classes.
    frame : str
        The fixed frame of the map.
    classes : Classes, optional
        What the labels mean; see `open_log`, as for `label_field`.
    label_field : str, optional
        Field of the hard labels.
    patience : float
        Seconds.
    max_gap : float
        See `Frames`.
    """

    begin: Callable[[Classes], Growing]
    frame: str = "map"
    classes: Classes | None = None
    label_field: str | None = None
    patience: float = 2.0
    max_gap: float = 1.0
    semantic_map: Growing | None = None
    taken: int = 0
    given_up: int = 0
    last_problem: str = ""
    _frames: Frames = field(init=False)
    _waiting: deque[Any] = field(default_factory=deque)

    def __post_init__(self) -> None:
        self._frames = Frames(self.max_gap)

    def on_transforms(self, message: Any, *, fixed: bool) -> None:
        """Take in a message of /tf, or of /tf_static if `fixed`, and the clouds that waited for it."""
        self._frames.add(message, fixed=fixed)
        self._frames.forget(2 * self.patience + self.max_gap)
        self._take_waiting()

    def on_cloud(self, message: Any) -> None:
        """Take in a sensor_msgs/PointCloud2, at once or when its pose is known."""
        self._waiting.append(message)
        self._take_waiting()

    def points(self, messages: Messages, stamp: int) -> Any | None:
        """Return the map as a sensor_msgs/PointCloud2 at its data; None where it is empty."""
        if self.semantic_map is None or not len(self.semantic_map):
            return None
        X = self.semantic_map.positions
        return messages.points(self.frame, stamp, prediction_columns(X, self.semantic_map.query(X)))

    def octomap(self, messages: Messages, stamp: int) -> Any | None:
        """Return the map as an octomap_msgs/Octomap; None where it is empty or no semantic OctoMap."""
        if not isinstance(self.semantic_map, HasOctree) or not len(self.semantic_map.positions):
            return None
        return messages.octomap(self.frame, stamp, tree_of(self.semantic_map))

    def _take_waiting(self) -> None:
        newest = max((stamp_of(message.header) for message in self._waiting), default=0)
        still: deque[Any] = deque()
        for message in self._waiting:
            try:
                self._take(message)
            except NoTransformError as error:
                if newest - stamp_of(message.header) <= self.patience * NS:
                    still.append(message)
                else:
                    self._give_up(error)
            except InputError as error:
                self._give_up(error)
        self._waiting = still

    def _take(self, message: Any) -> None:
        sensor = bare(message.header.frame_id)
        T = self._frames.lookup(self.frame, sensor, stamp_of(message.header))
        pose = SensorPose(T, known=sensor != self.frame)
        cloud = cloud_of(message, pose, Path("cloud"), field=self.label_field, classes=self.classes)
        if self.semantic_map is None:
            self.semantic_map = self.begin(cloud.classes)
            self.classes = cloud.classes
        self.semantic_map.update(cloud)
        self.taken += 1

    def _give_up(self, error: InputError) -> None:
        self.given_up += 1
        self.last_problem = str(error)


@dataclass(frozen=True)
class NodeOptions:
    """Topics, rate and file of the node; see `semgp ros2`."""

    topic: str
    rate: float
    save: Callable[[Growing, Path], None]
    out: Path | None = None
    octomap: bool = False


def run(live: LiveMap, options: NodeOptions) -> None:
    """Run the node until ROS 2 shuts down or Ctrl-C is pressed; save the map at the end.

    The node `semgp` subscribes to clouds, /tf and /tf_static, publishes `~/map` (sensor_msgs/PointCloud2) and, if
    asked for, `~/octomap` (octomap_msgs/Octomap), and offers `~/save` (std_srvs/Trigger).

    Raises
    ------
    InputError
        No ROS 2 is sourced.
    """
    try:
        import rclpy
        from rclpy.executors import ExternalShutdownException
    except ImportError as error:
        raise InputError(
            f"semgp ros2 needs the rclpy of your ROS 2 ({error}), which pip cannot install: source its setup.bash "
            "and install semgp for the Python of that ROS 2, for example in a virtual environment made with "
            "--system-site-packages."
        ) from error
    rclpy.init()
    node = rclpy.create_node("semgp")
    try:
        bind(node, live, options)
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # the usual end of a node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    if options.out is not None and live.semantic_map is not None:
        options.save(live.semantic_map, options.out)


def bind(node: Any, live: LiveMap, options: NodeOptions) -> None:
    """Connect a live map to a node of rclpy: subscriptions, publishers, the timer and the service."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data

    messages = of_ros2()
    kinds = messages.kinds
    latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(kinds(TF), "/tf", lambda m: live.on_transforms(m, fixed=False), 100)
    node.create_subscription(kinds(TF), "/tf_static", lambda m: live.on_transforms(m, fixed=True), latched)
    node.create_subscription(kinds(POINTS), options.topic, live.on_cloud, qos_profile_sensor_data)
    points = node.create_publisher(kinds(POINTS), "~/map", 1)
    octomap = node.create_publisher(kinds(OCTOMAP), "~/octomap", 1) if options.octomap else None

    def publish() -> None:
        stamp = node.get_clock().now().nanoseconds
        for publisher, message in ((points, live.points), (octomap, live.octomap)):
            made = None if publisher is None else message(messages, stamp)
            if publisher is not None and made is not None:
                publisher.publish(made)
        if live.last_problem:
            node.get_logger().warning(f"{live.given_up} clouds given up, the last: {live.last_problem}")
            live.last_problem = ""

    def save(_: Any, response: Any) -> Any:
        response.success, response.message = _saved(live, options)
        return response

    node.create_timer(1 / options.rate, publish)
    node.create_service(kinds("std_srvs/srv/Trigger"), "~/save", save)


def _saved(live: LiveMap, options: NodeOptions) -> tuple[bool, str]:
    if options.out is None or live.semantic_map is None:
        return False, "no clouds yet, or the node was started without a file to save to."
    try:
        options.save(live.semantic_map, options.out)
    except (InputError, OSError) as error:
        return False, str(error)
    return True, f"saved to {options.out}"
