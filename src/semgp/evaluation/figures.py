"""The paper's pictures of maps: colour image, truth, OctoMap, GP map, and how sure the GP is, from one view.

Source: figures 1, 4 and 5 of Ghaffari Jadidi et al. (2017), "Gaussian Processes Semantic Map Representation",
which leave out the uncertainty.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.evaluation.names import method_name
from semgp.evaluation.task import Result, Task
from semgp.picture import View, by_class, by_value, colour_bar, disc_sizes, legend, panels, splat, stack, view_of
from semgp.picture.image import Picture
from semgp.prediction import Prediction
from semgp.upward import direction

MOST_BITS = 2.0
"""Entropy of the last colour, in bits: that of four classes equally likely."""
FONT_SIZE = 29
"""Height of the letters in pixels, so that a row of five pictures can be read on a page."""


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure of a report.

    Parameters
    ----------
    name : str
        Name of its file, without suffix.
    caption : str
        What it shows.
    png : bytes
        The file, in PNG.
    """

    name: str
    caption: str
    png: bytes


@dataclass(frozen=True, eq=False)
class MapRow:
    """Pictures of one task from one view, with their titles, and the labels (L,) that occur in them."""

    classes: Classes
    pictures: tuple[Picture, ...]
    titles: tuple[str, ...]
    labels: NDArray[np.int32]


def picture_figure(name: str, caption: str, picture: Picture) -> Figure:
    """Return a picture (H, W, 3) as a figure."""
    file = io.BytesIO()
    Image.fromarray(picture).save(file, format="PNG", optimize=True)
    return Figure(name, caption, file.getvalue())


def camera_view(truth: LabelledCloud, width: int = 640) -> View:
    """Return a view of a depth camera's frame, from a little above the camera."""
    return view_of(truth.points, truth.origin, up=direction(truth.up), width=width, height=width * 3 // 4)


def street_view(truth: LabelledCloud, width: int = 720) -> View:
    """Return a view along the street from behind and above the first lidar, x forward and z up in its frame.

    Raises
    ------
    InputError
        A cloud without the pose of its sensor.
    """
    if truth.T_world_sensor is None:
        raise InputError("a street view needs the lidar's pose: give the cloud its T_world_sensor.")
    R, origin = truth.T_world_sensor[:3, :3], truth.T_world_sensor[:3, 3]
    eye, target = (R @ np.array(p) + origin for p in ((-16.0, 0.0, 13.0), (9.0, 0.0, -1.0)))
    return View.look_at(eye, target, R[:, 2], fov=38, width=width, height=width * 3 // 5)


def map_row(task: Task, results: Sequence[Result], view: View, disc_scale: float = 1.0) -> MapRow:
    """Draw colours (where there are any), truth, each method's labels, and the last method's entropy.

    Parameters
    ----------
    task : Task
        The task that the results are of.
    results : sequence of Result
        The methods to show, at least one; the last one's uncertainty is drawn.
    view : View
        Where all pictures are taken from.
    disc_scale : float, optional
        Size of the discs that stand for points, relative to `disc_sizes`: above one, the gaps between a lidar's
        rings close.

    Raises
    ------
    InputError
        No results, or results that are not of this task.
    """
    truth = task.truth
    known = truth.hard_labels != MISSING
    predictions = [r.prediction for r in results if r.prediction is not None]
    if not results or [len(p) for p in predictions] != [np.count_nonzero(known)] * len(results):
        raise InputError(
            "a row of maps needs results, with their predictions at the task's truly labelled points."
        )
    size = disc_scale * disc_sizes(truth.points)
    points, known_size = truth.points[known], size[known]

    def at_known(colours: NDArray[np.uint8]) -> Picture:
        return splat(points, colours, view, known_size)

    given = [truth.hard_labels[known], *(p.label for p in predictions)]
    pictures = [at_known(by_class(labels, truth.classes)) for labels in given]
    titles = ["truth", *map(_title, results)]
    if truth.colours is not None:
        pictures.insert(0, splat(truth.points, truth.colours, view, size))
        titles.insert(0, "colour image")
    pictures.append(at_known(by_value(_bits(predictions[-1]), 0, MOST_BITS)))
    titles.append(f"{method_name(results[-1].method)}: entropy")
    titles[0] = f"{task.name}, {task.experiment}: {titles[0]}"
    return MapRow(truth.classes, tuple(pictures), tuple(titles), np.unique(np.concatenate(given)))


def maps_figure(rows: Sequence[MapRow]) -> Figure:
    """Return rows of maps as one figure "maps", with the classes that occur and the colours of the entropy.

    Raises
    ------
    InputError
        No rows, or rows of different classes or numbers of pictures.
    """
    if not rows or any(r.classes != rows[0].classes or len(r.pictures) != len(rows[0].pictures) for r in rows):
        raise InputError("a figure of maps needs rows, all of the same classes and the same number of pictures.")
    pictures = [picture for row in rows for picture in row.pictures]
    titles = [title for row in rows for title in row.titles]
    grid = panels(pictures, titles, columns=len(rows[0].pictures), font_size=FONT_SIZE)
    labels = np.unique(np.concatenate([row.labels for row in rows]))
    unseen = "not observed" if MISSING in labels else None
    key = legend(only(rows[0].classes, labels), grid.shape[1], missing=unseen, font_size=FONT_SIZE)
    scale = f"entropy in bits, the last colour for {MOST_BITS:g} and more"
    bar = colour_bar(0, MOST_BITS, scale, width=900, font_size=FONT_SIZE)
    caption = (
        "Maps, each row from one view. The last picture is the entropy of the class probabilities of the map "
        "before it. Points without a true label are left out."
    )
    return picture_figure("maps", caption, stack([grid, key, bar]))


def only(classes: Classes, labels: NDArray[np.integer]) -> Classes:
    """Return the classes that labels speak of, in their order."""
    present = [int(c) for c in np.unique(labels) if c != MISSING]
    return Classes(tuple(classes.names[c] for c in present), tuple(classes.colours[c] for c in present))


def _title(result: Result) -> str:
    scores = result.scores
    return f"{method_name(result.method)}: AUC {scores.auc_total:.3f}, mIoU {scores.miou:.3f}"


def _bits(prediction: Prediction) -> NDArray[np.floating]:
    """Entropy (M,) in bits; NaN where nothing was observed."""
    return np.where(prediction.observed, prediction.entropy / math.log(2), np.nan)
