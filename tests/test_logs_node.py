"""The ROS 2 node: its logic without ROS 2, and its binding to a stand-in of rclpy's interfaces."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.logs.definitions import OCTOMAP, POINTS, TF
from semgp.logs.frames import NS
from semgp.logs.messages import of_rosbags
from semgp.logs.node import LiveMap, NodeOptions, run
from semgp.logs.pointcloud2 import columns_of
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import PRESETS
from semgp.octomap import SemanticOctoMap
from tests.log_samples import pose

MESSAGES = of_rosbags(ros1=False)
CLASSES = Classes(("road", "car"))
TIME = "builtin_interfaces/msg/Time"


def cloud_message(t: float, frame: str = "lidar") -> Any:
    rng = np.random.default_rng(round(10 * t))
    columns = {name: rng.uniform(-1, 1, 30).astype(np.float32) for name in "xyz"}
    return MESSAGES.points(frame, round(t * NS), {**columns, "label": rng.integers(0, 2, 30, np.int32)})


def tf_message(t: float, x: float) -> Any:
    return MESSAGES.transforms(round(t * NS), [("map", "base", pose(x, 0, 0))])


def live(**settings: Any) -> LiveMap:
    made = LiveMap(lambda classes: SemanticOctoMap(classes, 0.1), classes=CLASSES, **settings)
    made.on_transforms(MESSAGES.transforms(0, [("base", "lidar", pose(0, 0, 1))]), fixed=True)
    return made


def test_clouds_wait_for_their_pose_and_are_placed_by_it() -> None:
    node = live()
    node.on_transforms(tf_message(1.0, 0.0), fixed=False)
    node.on_cloud(cloud_message(1.5))
    assert node.taken == 0
    node.on_transforms(tf_message(2.0, 10.0), fixed=False)
    assert node.taken == 1
    columns = columns_of(cloud_message(1.5))
    points = np.stack([columns[c] for c in "xyz"], axis=1) + np.array([5.0, 0.0, 1.0])
    assert node.semantic_map is not None
    assert node.semantic_map.query(points).observed.all()


def test_a_gp_map_grows_and_answers() -> None:
    blocks = replace(PRESETS["general"], resolution=0.3)
    node = LiveMap(lambda classes: GPSemanticMap(classes, blocks), classes=CLASSES)
    node.on_transforms(MESSAGES.transforms(0, [("map", "lidar", pose(0, 0, 1))]), fixed=True)
    counts = []
    for t in (1.0, 2.0):
        node.on_cloud(cloud_message(t))
        columns = columns_of(node.points(MESSAGES, 0))
        assert set(columns["label"]) <= {0, 1}
        counts.append(len(columns["label"]))
    assert counts[0] < counts[1]


def test_clouds_without_a_pose_are_given_up_in_the_end() -> None:
    node = live(patience=1.0)
    for t in (1.0, 1.5, 2.5):
        node.on_cloud(cloud_message(t))
    assert (node.taken, node.given_up) == (0, 1)
    assert "no transform from 'lidar' to 'map'" in node.last_problem
    node.on_cloud(cloud_message(2.5, "map"))  # in the fixed frame already, but rays need a sensor
    assert node.given_up == 2
    assert "no T_world_sensor" in node.last_problem


def test_clouds_without_labels_are_given_up_with_advice() -> None:
    node = live()
    node.on_transforms(tf_message(1.0, 0.0), fixed=False)
    node.on_cloud(MESSAGES.points("lidar", NS, {name: np.zeros(2, np.float32) for name in "xyz"}))
    assert (node.taken, node.given_up) == (0, 1)
    assert "its points have no labels" in node.last_problem


def test_the_map_as_messages() -> None:
    node = live()
    assert node.points(MESSAGES, 0) is None
    assert node.octomap(MESSAGES, 0) is None
    node.on_transforms(tf_message(1.0, 0.0), fixed=False)
    node.on_cloud(cloud_message(1.0))
    message: Any = node.points(MESSAGES, 3 * NS)
    assert (message.header.frame_id, message.header.stamp.sec) == ("map", 3)
    assert {"x", "label", "p_road", "p_car", "entropy"} <= columns_of(message).keys()
    assert message.width == len(node.semantic_map.positions)  # type: ignore[union-attr]
    tree: Any = node.octomap(MESSAGES, 3 * NS)
    assert (tree.id, tree.binary, tree.resolution) == ("OcTree", True, 0.1)
    assert len(tree.data)


class FakeNode:
    """As much of rclpy.node.Node as the binding uses."""

    def __init__(self) -> None:
        self.subscriptions: dict[str, Callable[[Any], None]] = {}
        self.published: dict[str, list[Any]] = {}
        self.timers: list[tuple[float, Callable[[], None]]] = []
        self.services: dict[str, Callable[[Any, Any], Any]] = {}
        self.warnings: list[str] = []
        self.destroyed = False

    def create_subscription(self, kind: type, topic: str, callback: Callable[[Any], None], quality: Any) -> None:
        self.subscriptions[topic] = callback

    def create_publisher(self, kind: type, topic: str, quality: Any) -> Any:
        return SimpleNamespace(publish=self.published.setdefault(topic, []).append)

    def create_timer(self, seconds: float, callback: Callable[[], None]) -> None:
        self.timers.append((seconds, callback))

    def create_service(self, kind: type, name: str, callback: Callable[[Any, Any], Any]) -> None:
        self.services[name] = callback

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=7 * NS))

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.warnings.append)

    def destroy_node(self) -> None:
        self.destroyed = True


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> FakeNode:
    """Put a stand-in for rclpy and for ROS 2's message packages in place; what spins is set as `node.drive`."""
    fake = FakeNode()

    def module(name: str, **content: Any) -> None:
        made = ModuleType(name)
        vars(made).update(content)
        monkeypatch.setitem(sys.modules, name, made)

    module(
        "rclpy",
        init=lambda: None,
        create_node=lambda name: fake,
        spin=lambda node: node.drive(node),
        try_shutdown=lambda: None,
    )
    module("rclpy.executors", ExternalShutdownException=type("ExternalShutdownException", (Exception,), {}))
    module(
        "rclpy.qos",
        DurabilityPolicy=SimpleNamespace(TRANSIENT_LOCAL=1),
        QoSProfile=lambda **settings: settings,
        qos_profile_sensor_data=None,
    )
    names = ("sensor_msgs", "std_msgs", "tf2_msgs", "builtin_interfaces", "octomap_msgs")
    packages: dict[str, dict[str, Any]] = {name: {} for name in names}
    for kind in (POINTS, TF, OCTOMAP, "sensor_msgs/msg/PointField", "std_msgs/msg/Header", TIME):
        package, _, title = kind.split("/")
        packages[package][title] = MESSAGES.kinds(kind)
    for name, content in packages.items():
        module(f"{name}.msg", **content)
    module("std_srvs.srv", Trigger=object)
    return fake


def test_the_binding(node: FakeNode, tmp_path: Path) -> None:
    saved: list[tuple[int, Path]] = []
    mapped = live()
    out = tmp_path / "map.semgp"
    options = NodeOptions("/labelled", 2.0, lambda m, path: saved.append((len(m), path)), out, octomap=True)

    def drive(node: FakeNode) -> None:
        ((seconds, publish),) = node.timers
        assert seconds == 0.5
        publish()
        assert node.published == {"~/map": [], "~/octomap": []}
        answer = node.services["~/save"](None, SimpleNamespace(success=None, message=None))
        assert not answer.success
        node.subscriptions["/tf"](tf_message(1.0, 0.0))
        node.subscriptions["/labelled"](cloud_message(1.0))
        node.subscriptions["/labelled"](cloud_message(1.0, "map"))
        publish()
        publish()
        raise KeyboardInterrupt

    vars(node)["drive"] = drive
    run(mapped, options)
    assert [len(messages) for messages in node.published.values()] == [2, 2]
    cloud, tree = node.published["~/map"][0], node.published["~/octomap"][0]
    assert (cloud.data.typecode, tree.data.typecode) == ("B", "b")  # what rclpy takes without copying
    assert cloud.header.stamp.sec == 7
    assert len(node.warnings) == 1
    assert "1 clouds given up" in node.warnings[0]
    assert node.destroyed
    assert saved == [(len(mapped.semantic_map or ()), out)]


def test_the_save_service(node: FakeNode, tmp_path: Path) -> None:
    saved: list[Path] = []
    mapped = live()
    mapped.on_transforms(tf_message(1.0, 0.0), fixed=False)
    mapped.on_cloud(cloud_message(1.0))

    def drive(node: FakeNode) -> None:
        answer = node.services["~/save"](None, SimpleNamespace(success=None, message=None))
        assert answer.success
        assert str(tmp_path / "map.semgp") in answer.message

    vars(node)["drive"] = drive
    run(mapped, NodeOptions("/points", 1.0, lambda m, path: saved.append(path), tmp_path / "map.semgp"))
    assert saved == [tmp_path / "map.semgp"] * 2  # when asked to, and at the end


def test_without_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(InputError, match=r"source its setup.bash"):
        run(live(), NodeOptions("/points", 1.0, lambda m, path: None))
