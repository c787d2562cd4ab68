"""The paper's OctoMap figure: a room of Stanford 2D-3D-S as a Semantic OctoMap at several resolutions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.evaluation.cubes import draw_cubes
from semgp.evaluation.figures import FONT_SIZE, Figure, only, picture_figure
from semgp.octomap import SemanticOctoMap
from semgp.picture import GREY, View, by_class, disc_sizes, legend, panels, splat, stack, view_of
from semgp.picture.image import Picture
from semgp.readers import read_pcd

STANFORD = Classes(
    ("wall", "chair", "table", "bookcase", "door", "beam", "clutter"),
    (
        *((150, 176, 205), (233, 184, 60), (196, 92, 70), (92, 158, 104)),
        *((140, 100, 66), (122, 108, 178), (214, 132, 172)),
    ),
)
"""The classes of the room's pieces."""
STANFORD_IDS = (1, 2, 3, 5, 6, 7, 9)
"""What the files call them. They name no classes: these follow from the pieces, whose numbers are the places of
the data set's annotation files in alphabetical order (beam_1 to wall_3), ceiling and floor left out."""
RESOLUTIONS = (0.05, 0.1, 0.2)
"""Edges in metres of the voxels that the figure shows."""


def stanford_room(folder: str | Path) -> LabelledCloud:
    """Read a room that is stored as labelled pieces, `*.pcd`.

    Raises
    ------
    FileFormatError
        No pieces, damaged ones, or labels other than `STANFORD_IDS`.
    """
    pieces = [read_pcd(path) for path in sorted(Path(folder).glob("*.pcd"))]
    if not pieces:
        raise FileFormatError(folder, "holds no pieces of a room: it has no *.pcd.")
    label_of = np.full(max(STANFORD_IDS) + 2, MISSING, dtype=np.int32)  # the last one for labels out of range
    label_of[list(STANFORD_IDS)] = np.arange(len(STANFORD_IDS))
    ids = np.concatenate([piece.hard_labels for piece in pieces])
    labels = label_of[np.clip(ids, MISSING, len(label_of) - 1)]
    if (labels == MISSING).any():
        unknown = ", ".join(str(i) for i in np.unique(ids[labels == MISSING])[:5])
        raise FileFormatError(folder, f"has labels that are no class of the room: {unknown}.")
    return LabelledCloud(np.concatenate([piece.points for piece in pieces]), STANFORD, labels=labels)


def into_room(points: NDArray[np.float64], width: int = 640) -> View:
    """Return a view into a room, z up, through its side of greatest y, from above."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    eye = (lower + upper) / 2 + (-0.28, 1.15, 1.1) * (upper - lower)
    return view_of(points, eye, tilt=0, fov=40, width=width, height=width * 2 // 3)


def stanford_figure(folder: str | Path) -> Figure:
    """Read a room as `stanford_room` does and draw it as `octomap_figure` does."""
    room = stanford_room(folder)
    caption = "A room of Stanford 2D-3D-S with its true labels, and its Semantic OctoMap at several resolutions."
    return octomap_figure("stanford-room", caption, room, into_room(room.points))


def octomap_figure(
    name: str, caption: str, cloud: LabelledCloud, view: View, resolutions: Sequence[float] = RESOLUTIONS
) -> Figure:
    """Draw a labelled cloud, and its Semantic OctoMap at several resolutions, in the colours of the classes.

    Where the cloud has colours, a second row shows those, and the voxels' mean colours. Rays are cast where the
    sensor's pose is known.

    Raises
    ------
    InputError
        No resolutions, or a cloud without labels.
    """
    if not resolutions or not cloud.labelled.any():
        raise InputError("an OctoMap figure needs a cloud with labels and at least one resolution.")
    given = by_class(cloud.hard_labels, cloud.classes)
    size = disc_sizes(cloud.points)
    maps = [_octomap(cloud, resolution) for resolution in resolutions]
    titles = ["points", *(f"voxels of {100 * resolution:g} cm" for resolution in resolutions)]
    pictures = [splat(cloud.points, given, view, size), *(_in_classes(octomap, view) for octomap in maps)]
    if cloud.colours is not None:
        titles += ["colours", *(f"mean colours, {100 * resolution:g} cm" for resolution in resolutions)]
        pictures.append(splat(cloud.points, cloud.colours, view, size))
        pictures += [_in_mean_colours(octomap, view) for octomap in maps]
    grid = panels(pictures, titles, columns=1 + len(maps), font_size=FONT_SIZE)
    unlabelled = None if cloud.labelled.all() else "no label"
    key = legend(only(cloud.classes, cloud.hard_labels), grid.shape[1], missing=unlabelled, font_size=FONT_SIZE)
    return picture_figure(name, caption, stack([grid, key]))


def _octomap(cloud: LabelledCloud, resolution: float) -> SemanticOctoMap:
    octomap = SemanticOctoMap(cloud.classes, resolution, rays=cloud.origin is not None)
    octomap.update(cloud)
    return octomap


def _in_classes(octomap: SemanticOctoMap, view: View) -> Picture:
    """The occupied voxels in the colours of their most probable classes."""
    centres = octomap.occupied(pruned=False).centres
    colours = by_class(octomap.query(centres).label, octomap.classes)
    return draw_cubes(centres, octomap.resolution, colours, view)


def _in_mean_colours(octomap: SemanticOctoMap, view: View) -> Picture:
    """The occupied voxels in the mean colours of their points."""
    centres = octomap.occupied(pruned=False).centres
    colours, known = octomap.query_colours(centres)
    colours[~known] = GREY
    return draw_cubes(centres, octomap.resolution, colours, view)
