"""Scans of an RGB-D recording, labelled by a network as they are read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.readers.grids import sample
from semgp.readers.images import read_colour_image
from semgp.readers.protocol import Scans
from semgp.segmentation.images import images_of
from semgp.segmentation.protocol import Segmenter


def labelled_scans(
    path: str | Path, scans: Sequence[LabelledCloud], segmenter: Segmenter, *, soft: bool = True
) -> Scans:
    """Return scans of an RGB-D recording with the labels that a network gives them, each when it is asked for.

    The labels are those that a label folder of the network's answers would give, but for the rounding of these.

    Parameters
    ----------
    path : str or Path
        The recording: an RGB-D folder, or a folder of NYU frames.
    scans : sequence of LabelledCloud
        Its scans, from `semgp.readers.open_scans(path)`; their own labels are replaced.
    segmenter : Segmenter
        The network.
    soft : bool
        Class probabilities, where the network gives them, rather than labels.

    Raises
    ------
    InputError
        Scans that come from no images.
    """
    images = images_of(path) if Path(path).is_dir() else ()
    if len(images) != len(scans):
        raise InputError(f"{path}: a network labels scans that have a colour image each: give an RGB-D folder.")

    def scan(i: int) -> LabelledCloud:
        return labelled(scans[i], images[i], segmenter, soft=soft)

    return Scans(range(len(scans)), scan)


def labelled(cloud: LabelledCloud, image: Path, segmenter: Segmenter, *, soft: bool = True) -> LabelledCloud:
    """Return a cloud whose labels are what a network says of its pixels in an image.

    Raises
    ------
    InputError
        A cloud without `pixels`; FileFormatError for an image that is damaged or of another size.
    """
    if cloud.pixels is None or cloud.image_shape is None:
        raise InputError(f"{image}: the scan does not say from which pixels its points are.")
    answer = segmenter.segment(read_colour_image(image, cloud.image_shape))
    if soft and answer.probability is not None:
        weights = sample(answer.probability, cloud.pixels, cloud.image_shape, corners=answer.corners)
        return replace(cloud, classes=segmenter.classes, labels=None, weights=weights)
    labels = answer.label[cloud.pixels[:, 0], cloud.pixels[:, 1]]
    return replace(cloud, classes=segmenter.classes, labels=labels, weights=None)
