"""The reader of robot logs: what `open_scans` calls for a bag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.logs.bag import is_bag

if TYPE_CHECKING:
    from semgp.logs.scans import LogScans


def open_log(
    path: str | Path,
    *,
    topic: str | None = None,
    field: str | None = None,
    classes: Classes | None = None,
    features: Sequence[str] = (),
    labelled: bool = True,
    frame: str | None = None,
    odometry: str | None = None,
    pose_frame: str | None = None,
    covariance: bool = True,
    max_gap: float = 1.0,
    depth: str | None = None,
    labels: str | None = None,
    camera_info: str | None = None,
    colour: str | None = None,
    max_depth: float = 10.0,
    stride: int | None = None,
    tolerance: float = 0.02,
) -> LogScans:
    """Return the scans of a ROS 1 or ROS 2 bag.

    The bag is read through once, for poses and stamps; the clouds themselves are read when they are asked for.
    Each is placed by the pose of its own stamp, interpolated between the samples before and after it. Scans
    without such a pose are skipped and listed in `skipped`.

    Parameters
    ----------
    path : str or Path
        A `.bag`, a folder with `metadata.yaml`, or a single `.mcap` or `.db3`.
    topic : str, optional
        Topic of sensor_msgs/PointCloud2; may be left out where there is only one.
    field : str, optional
        Field of the hard labels; left out, `label`, `class` or `classification`. Soft labels are fields
        `p_<class name>` or `prob_<number>`, or one field `probabilities` with a value for each class.
    classes : Classes, optional
        Left out, those of a vision_msgs/LabelInfo of the bag, else named after the soft labels, or numbered. Where
        the bag's own have the same names, labels are their numbers; else labels are the raw ids of these classes.
    features : sequence of str
        Fields that become the cloud's features, such as `intensity`.
    labelled : bool
        False takes clouds without labels, too.
    frame : str, optional
        The fixed frame that becomes the world, such as "map" or "odom". Left out, it is the root of tf above the
        sensor, or the frame that the odometry is in. Clouds that are in this frame already are taken as they are,
        without a pose; so is a single cloud that nothing in tf moves. REP-103 and REP-105 apply: metres,
        z up, optical frames of cameras x right and z forward.
    odometry : str, optional
        Topic of nav_msgs/Odometry, geometry_msgs/PoseStamped or PoseWithCovarianceStamped, which gives the moving
        part of the pose instead of tf; tf then only says where the sensor sits on the body.
    pose_frame : str, optional
        The frame that these poses are of, instead of the messages' `child_frame_id`.
    covariance : bool
        Take the covariance of these poses, carried over to the sensor, as `pose_covariance`. False where a driver
        fills it with placeholders.
    max_gap : float
        Poses are interpolated between samples at most so many seconds apart.
    depth, labels, camera_info : str, optional
        Instead of point clouds, topics of depth and label images of one camera and its CameraInfo. Images are
        sensor_msgs/Image or CompressedImage: depth as PNG or by compressedDepth (PNG or RVL), labels as PNG. A
        topic of depth called `image_raw`, also with /compressed or /compressedDepth after it, holds raw images:
        the lens's distortion D is undone. Any other holds rectified ones.
    colour : str, optional
        Topic of the camera's colour images, registered to its depth; compressed as PNG or JPEG.
    max_depth : float
        Depths beyond it, in metres, are left out.
    stride : int, optional
        Take every so many-th pixel of every so many-th row; left out, so many that 80,000 remain at most.
    tolerance : float
        Images whose stamps are so many seconds apart are of the same moment.

    Raises
    ------
    InputError
        No such topic, no poses, or a choice that has to be made: the message says which.
    FileFormatError
        A bag that is damaged or truncated.
    MissingExtraError
        rosbags is not installed: the extra `ros` brings it.
    """
    # The readers import this module, and these import the readers.
    from semgp.logs.bag import Bag
    from semgp.logs.clouds import Clouds, cloud_topic
    from semgp.logs.frames import bare
    from semgp.logs.images import Images
    from semgp.logs.poses import Odometry, Poses, frames_of
    from semgp.logs.scans import Source, classes_in, scans_of

    if depth is None and (labels, camera_info, colour) != (None, None, None):
        raise InputError(
            "labels, camera_info and colour of a log are topics that go with depth images: give depth=..."
        )
    if depth is not None and topic is not None:
        raise InputError("a log's scans are made of clouds (topic=...) or of images (depth=...), not of both.")
    bag = Bag(path)
    classes = _meant(classes, classes_in(bag))
    source: Source
    if depth is None:
        source = Clouds(bag, cloud_topic(bag, topic), field, classes, tuple(features), labelled)
    else:
        source = Images(bag, depth, labels, camera_info, colour, classes, max_depth, tolerance, stride)
    moving = None if odometry is None else Odometry(bag, odometry, pose_frame, max_gap)
    poses = Poses(frames_of(bag, max_gap), None if frame is None else bare(frame), moving)
    return scans_of(bag, source, poses, covariance=covariance)


def _meant(classes: Classes | None, said: Classes | None) -> Classes | None:
    """Return the classes of the labels, from those that the user gives and those that the bag names."""
    if classes is None or said is None or said.names != classes.names:
        return said if classes is None else classes
    return Classes(classes.names, classes.colours)


@dataclass(frozen=True)
class LogReader:
    """The registry's reader of robot logs."""

    name: str = "log"
    layout: str = (
        "a robot log: a ROS 1 bag (.bag), a ROS 2 bag (a folder with metadata.yaml), a .mcap or .db3 file"
    )

    def matches(self, path: Path) -> bool:
        """Tell whether the path is a bag by its name or its folder's contents."""
        return is_bag(path)

    scans = staticmethod(open_log)
