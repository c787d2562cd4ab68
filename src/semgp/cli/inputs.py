"""The options of every command that reads scans, and the scans that they mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from semgp.cli.console import MANNERS, STDERR, counted
from semgp.cli.places import require_place
from semgp.errors import InputError
from semgp.upward import Up

if TYPE_CHECKING:
    from semgp.readers import Scans


@dataclass(frozen=True)
class Inputs:
    """How scans are read: options shared by the commands that read labelled scans.

    Parameters
    ----------
    classes
        What the labels in the files mean: a class file (.toml, .csv, SemanticKITTI .yaml), a built-in list
        (nyu13, nyu40, scannet, semantickitti, ade20k, ade20k-32), or the number of classes. Left out, what the
        files say; where they only number their classes, all of them are read once more to know how many.
    remap
        Turn the classes into others: a class file that says which each one takes in (from), or a built-in
        remapping (ade20k-32-to-nyu13, nyu40-to-nyu13).
    labels
        Which labels of a data set: labels (the truth), predictions, or a folder of label files or images.
    network
        Label the frames of RGB-D recordings by a segmentation network, a .tflite or .onnx file, as "semgp segment"
        does; --classes are then the network's.
    stride
        Take every N-th pixel of every N-th row of RGB-D recordings; left out, so many that 80,000 remain at most.
    max_depth
        Depths of RGB-D recordings beyond so many metres are not believed; left out, 10.
    depth_scale
        Units a metre of the depth images of RGB-D recordings; left out, 1000, or 5000 for TUM's.
    field
        Field of point files that holds the labels, where it is not called label, class or classification.
    poses
        Trajectory of the sensor, TUM's or KITTI's, for a folder of point files in the sensor's frame; or other
        poses of the camera for a SemanticKITTI sequence.
    topic
        Robot logs: topic of labelled PointCloud2, where there are several; "semgp topics" lists them.
    frame
        Robot logs: the fixed frame that the map is in; left out, the root of tf above the sensor.
    odometry
        Robot logs: topic of nav_msgs/Odometry or of poses that says where the robot was, instead of tf.
    pose_frame
        Robot logs: the frame that these poses are of, where the messages do not say.
    max_gap
        Robot logs: poses are interpolated between samples at most so many seconds apart; left out, 1.
    depth
        Robot logs: instead of clouds, topic of depth images; --labels is then the topic of label images.
    camera_info
        Robot logs: topic of the CameraInfo of the depth images.
    colour
        Robot logs: topic of colour images that go with the depth.
    first
        Number of the first scan that is taken, counted from 0 over all paths.
    last
        Number of the last scan that is taken.
    every
        Take every N-th scan only.
    """

    classes: str | None = None
    remap: str | None = None
    labels: str | None = None
    network: Path | None = None
    stride: int | None = None
    max_depth: float | None = None
    depth_scale: float | None = None
    field: str | None = None
    poses: Path | None = None
    topic: str | None = None
    frame: str | None = None
    odometry: str | None = None
    pose_frame: str | None = None
    max_gap: float | None = None
    depth: str | None = None
    camera_info: str | None = None
    colour: str | None = None
    first: int = 0
    last: int | None = None
    every: int = 1


AnyInputs = Annotated[Inputs, Parameter(name="*", group="Scans")]
"""The type of a command's parameter `inputs`: its options stand beside the command's own."""

Upward = Annotated[Up | None, Parameter(allow_leading_hyphen=True)]
"""The type of options `--up`."""

PLAIN = Inputs()
"""Every scan, as its file says."""

_ABOUT_SCANS = ("classes", "remap", "network", "first", "last", "every")
"""Options that this module works on; the others go to the readers as they are."""


def sources(paths: Sequence[Path], inputs: Inputs = PLAIN) -> Scans:
    """Return the scans at some paths, one after the other, each read when it is asked for and none kept.

    Raises
    ------
    InputError
        No paths, options that a format does not have, or no scans left. While scans are read: damaged files, and
        classes that differ from the first scan's.
    """
    if not paths:
        raise InputError("give at least one scan: a point file or a data-set folder.")
    require_place(*paths)

    from semgp.class_files import class_list, remapping
    from semgp.cli.reading import Reading
    from semgp.logs.scans import LogScans
    from semgp.readers import Scans, open_scans
    from semgp.segmentation import labelled_scans, segmenter_of

    options: dict[str, Any] = {
        f.name: getattr(inputs, f.name) for f in fields(inputs) if f.name not in _ABOUT_SCANS
    }
    options = {name: value for name, value in options.items() if value is not None}
    if inputs.classes is not None:
        options["classes"] = class_list(inputs.classes)
    mapping = None if inputs.remap is None else remapping(inputs.remap)
    if inputs.network is None:
        parts = [open_scans(path, **options) for path in paths]
    else:
        segmenter = segmenter_of(inputs.network, options.pop("classes", None), mapping)
        parts = [labelled_scans(path, open_scans(path, **options), segmenter) for path in paths]
        mapping = None  # the segmenter has it
    for path, part in zip(paths, parts):
        if isinstance(part, LogScans) and part.skipped:
            why = part.skipped[0][1]
            STDERR.print(f"{path}: {len(part.skipped)} scans skipped, the first because {why}", markup=False)
    chosen = _chosen(sum(len(part) for part in parts), inputs)
    return Scans(chosen, Reading(parts, chosen, mapping, count_classes=inputs.classes is None))


def at_most(scans: Scans, count: int, stride: int) -> Scans:
    """Return at most `count` of the scans, from the middle of the sequence, at most `stride` apart.

    So few that they fit in memory, so close that they still see the same places.
    """
    step = min(max(1, len(scans) // count), stride)
    begin = max(0, (len(scans) - count * step) // 2)
    return scans[begin : begin + count * step : step]


def dropped_labels(scans: Scans) -> dict[str, int]:
    """Return how many labels of each class --remap has dropped from the `sources` that were read so far."""
    from semgp.cli.reading import Reading

    return dict(scans.scan.dropped) if isinstance(scans.scan, Reading) else {}


def tell_labels(scans: Scans) -> None:
    """Tell on standard error how many of the points that were read have labels, and which --remap has dropped."""
    from semgp.cli.reading import Reading

    reading = scans.scan
    if MANNERS.quiet or not isinstance(reading, Reading) or not reading.points:
        return
    names = [name for name, n in zip(reading.names, reading.labels) if n]
    lines = [
        f"{reading.labels.sum():,} of {reading.points:,} points have a label, of {counted(len(names), 'class')}"
    ]
    if names and reading.nameless:
        lines[0] += "; --classes says what their numbers mean"
    if dropped := dropped_labels(scans):
        words = ", ".join(f"{n:,} of {name}" for name, n in sorted(dropped.items(), key=lambda item: -item[1]))
        lines.append(f"labels that --remap has no class for: {words}")
    for line in lines:
        STDERR.print(line, markup=False, highlight=False, soft_wrap=True)


def _chosen(n: int, inputs: Inputs) -> range:
    if not n:
        raise InputError("there are no scans at the paths that were given.")
    first, last, every = inputs.first, inputs.last, inputs.every
    if every < 1 or first < 0 or (last is not None and last < first):
        raise InputError("--every is at least 1, --first at least 0, and --last not below --first.")
    if first >= n:
        raise InputError(f"there is no scan {first}: there are {n}, counted from 0.")
    return range(n)[first : None if last is None else last + 1 : every]
