"""Point clouds of a log: what is labelled in their fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.logs.bag import Bag, Place
from semgp.logs.definitions import POINTS
from semgp.logs.pointcloud2 import columns_of
from semgp.logs.poses import SensorPose
from semgp.readers.fields import LABEL_NAMES, cloud_from_fields

HOW_TO_LABEL = (
    "name the field that holds class numbers by field=..., write labels into the clouds before they are recorded, "
    "take depth and label images instead (depth=..., labels=..., camera_info=...), or take the clouds without "
    "labels by labelled=False"
)


@dataclass(frozen=True)
class Clouds:
    """The clouds of a topic of sensor_msgs/PointCloud2; for the options see `open_log`."""

    bag: Bag
    topic: str
    field: str | None
    classes: Classes | None
    features: tuple[str, ...]
    labelled: bool

    def moments(self) -> tuple[list[tuple[Place, ...]], list[tuple[float, str]]]:
        """Return what is read together, and what cannot be read and why: see `Source`."""
        return [(place,) for place in self.bag.places(self.topic)], []

    def read(self, places: Sequence[Place], pose: SensorPose) -> LabelledCloud:
        """Read a cloud and place it in the world."""
        return cloud_of(
            self.bag.message(places[0]),
            pose,
            self.bag.path,
            field=self.field,
            classes=self.classes,
            features=self.features,
            labelled=self.labelled,
        )


def cloud_of(
    message: Any,
    pose: SensorPose,
    source: Path,
    *,
    field: str | None = None,
    classes: Classes | None = None,
    features: tuple[str, ...] = (),
    labelled: bool = True,
) -> LabelledCloud:
    """Return the cloud of a sensor_msgs/PointCloud2, in the world; for the options see `open_log`.

    Parameters
    ----------
    message : PointCloud2
        The message.
    pose : SensorPose
        Where its frame was.
    source : Path
        Where it comes from, for error messages.

    Raises
    ------
    InputError
        Fields that are damaged, are not there or hold what they cannot mean.
    """
    columns = columns_of(message)
    if field is not None:
        if field not in columns:
            raise InputError(f"it has no field {field!r}; its fields are {', '.join(columns)}.")
        others = {name: column for name, column in columns.items() if name.lower() not in LABEL_NAMES}
        columns = others | {"label": columns[field]}
    if labelled and not any(_is_label(name.lower()) for name in columns):
        raise InputError(f"its points have no labels, only the fields {', '.join(columns)}: {HOW_TO_LABEL}.")
    cloud = cloud_from_fields(source, columns, classes=classes, features=features)
    T = pose.T_world_frame
    return replace(cloud, points=cloud.points @ T[:3, :3].T + T[:3, 3], T_world_sensor=pose.T_world_sensor)


def cloud_topic(bag: Bag, topic: str | None) -> str:
    """Return the topic of the clouds: the one that is asked for, or the only one.

    Raises
    ------
    InputError
        None or several to choose from, no such topic, or one of another type.
    """
    if topic is not None:
        return bag.require(topic, POINTS).name
    found = bag.topics_of(POINTS)
    if len(found) == 1:
        return found[0].name
    choice = "several topics" if found else "no topic"
    raise InputError(
        f"{bag.path} has {choice} of {POINTS}: choose one by topic=..., or images by depth=...; {bag.listing()}"
    )


def _is_label(name: str) -> bool:
    return name in LABEL_NAMES or name.startswith(("p_", "prob_"))
