"""`semgp topics` and `semgp ros2`: what a robot log holds, and mapping as the robot drives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from semgp.cli.console import STDOUT, report
from semgp.cli.places import require_place

if TYPE_CHECKING:
    from semgp.classes import Classes
    from semgp.logs.node import Growing


def topics(bag: Path, /) -> None:
    """List the topics of a robot log with types and counts, how long it is, and the frames of its tf.

    What "semgp build" needs to be told: --topic is one of sensor_msgs/msg/PointCloud2. Or --depth and --labels are
    two of sensor_msgs/msg/Image or CompressedImage, and --camera-info one of sensor_msgs/msg/CameraInfo.

    Example: semgp topics run.mcap

    Parameters
    ----------
    bag
        A ROS 1 bag (.bag), a ROS 2 bag (a folder with metadata.yaml), or one of its files (.mcap, .db3).
    """
    require_place(bag)

    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from semgp.errors import InputError
    from semgp.logs.bag import Bag, is_bag
    from semgp.logs.frames import NS
    from semgp.logs.poses import frames_of

    if not is_bag(bag):
        raise InputError(
            f"{bag} is no robot log: give a .bag, .mcap or .db3 file, or a folder with metadata.yaml."
        )
    log = Bag(bag)
    found = sorted(log.topics.values(), key=lambda topic: topic.name)
    seconds = max(log.end - log.begin, 0) / NS
    frames = frames_of(log, max_gap=1.0)
    table = Table(title=f"{bag}: {seconds:,.1f} s", title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    for heading in ("topic", "type"):
        table.add_column(heading, overflow="fold")
    table.add_column("messages", justify="right", no_wrap=True)
    for topic in found:
        table.add_row(topic.name, topic.type, f"{topic.count:,}")
    rows = [{"topic": topic.name, "type": topic.type, "messages": topic.count} for topic in found]
    report(table, seconds=seconds, topics=rows, frames=frames.names)
    STDOUT.print(f"frames of tf: {', '.join(frames.names) or 'none'}", markup=False, highlight=False)


def ros2(
    *,
    topic: str = "/points",
    frame: str = "map",
    classes: str | None = None,
    field: str | None = None,
    kind: Literal["gp", "octomap"] = "gp",
    model: str = "outdoor-lidar",
    resolution: float | None = None,
    free_space: Annotated[bool, Parameter(negative="")] = False,
    octomap: Annotated[bool, Parameter(negative="")] = False,
    rate: float = 0.5,
    patience: float = 2.0,
    out: Path | None = None,
) -> None:
    """Map labelled clouds of a running ROS 2 as they come, and publish the map.

    A node "semgp" that imports the rclpy of the ROS 2 that is sourced. It subscribes to a topic of labelled
    PointCloud2, to /tf and /tf_static; publishes ~/map (PointCloud2: label, colour, class probabilities, variance,
    entropy) and ~/octomap; and saves the map when the service ~/save (std_srvs/Trigger) is called and at the end.
    rclpy is not on PyPI: this command was tested against a stand-in for it, not against a running ROS 2.

    Example: semgp ros2 --topic /lidar/labelled --classes semantickitti --out drive.semgp

    Parameters
    ----------
    topic
        The topic of the clouds.
    frame
        The fixed frame of the map, such as map or odom.
    classes
        What the labels mean: a class file, a built-in list, or the number of classes. Left out, what the fields of
        the first cloud say, which must be p_CLASS for each class.
    field
        Field of the labels, where it is not called label, class or classification.
    kind
        The GP map, or the semantic OctoMap.
    model
        The GP's model: a preset of "semgp build".
    resolution
        Edge of a voxel in metres, instead of the model's; of the OctoMap, 0.2 where left out.
    free_space
        The GP keeps free space, too.
    octomap
        Publish ~/octomap (octomap_msgs), too; for the OctoMap.
    rate
        So many times a second the map is published.
    patience
        A cloud waits so many seconds for its pose in tf, then it is given up.
    out
        The map file to save.
    """
    from semgp.class_files import class_list
    from semgp.errors import InputError
    from semgp.logs.node import LiveMap, NodeOptions, run

    if not rate > 0 or not patience >= 0:
        raise InputError("--rate must be positive, and --patience not negative.")
    if octomap and kind != "octomap":
        raise InputError("--octomap is for --kind octomap: the GP map is no octree.")
    known = None if classes is None else class_list(classes)
    begin = _beginning(kind, model, resolution, free_space)
    live = LiveMap(begin, frame, known, field, patience)
    run(live, NodeOptions(topic, rate, _save, out, octomap))
    report(
        f"{live.taken} clouds mapped, {live.given_up} given up" + ("" if out is None else f"; saved to {out}"),
        clouds=live.taken,
        given_up=live.given_up,
        out=out,
    )


def _beginning(kind: str, model: str, resolution: float | None, free_space: bool) -> Callable[[Classes], Growing]:
    """Return what makes an empty map of some classes."""
    from semgp.errors import InputError
    from semgp.maps.free_space import FreeSpace
    from semgp.maps.gp import GPSemanticMap
    from semgp.maps.presets import PRESETS
    from semgp.octomap import SemanticOctoMap

    if kind == "octomap":
        return lambda classes: SemanticOctoMap(classes, 0.2 if resolution is None else resolution)
    if model not in PRESETS:
        raise InputError(f"--model must be one of {', '.join(PRESETS)}, not {model!r}.")
    blocks = PRESETS[model] if resolution is None else replace(PRESETS[model], resolution=resolution)
    return lambda classes: GPSemanticMap(classes, blocks, free=FreeSpace() if free_space else None)


def _save(semantic_map: Any, out: Path) -> None:
    from semgp.maps.files import save_map

    save_map(semantic_map, out)
