"""Diagrams of one set of scores: what is taken for what, and how far probabilities can be believed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.evaluation.calibration import Reliability
from semgp.evaluation.canvas import BLUE, GREY, RED, canvas, png
from semgp.evaluation.figures import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CONFIDENCE, ACCURACY = "probability of the most probable class", "share of right labels"
"""The axes of a reliability diagram."""
_LEAST_SHARE = 0.005
"""Shares of a row that round to 0 % are not written."""


def confusion_diagram(confusion: NDArray[np.int64], classes: Classes) -> Figure:
    """Draw a confusion matrix: of each true class, the share of points that was given each label.

    Rows are the classes of the truth, with their points; columns are those and what else was given, "not observed"
    the last. Parameters as `semgp.evaluation.metrics.confusion` returns them.

    Raises
    ------
    InputError
        A matrix that is not of these classes, or without points.
    MissingExtraError
        matplotlib is not installed.
    """
    expected = (len(classes), len(classes) + 1)
    if confusion.shape != expected or not confusion.any():
        raise InputError(
            f"a confusion matrix of {len(classes)} classes counts points and has shape {expected}, not "
            f"{confusion.sum()} points and shape {confusion.shape}."
        )
    points = confusion.sum(axis=1)
    rows = np.flatnonzero(points)
    columns = np.flatnonzero((confusion.sum(axis=0) > 0) | np.append(points > 0, False))
    share = confusion[np.ix_(rows, columns)] / points[rows, None]
    names = [*classes.names, "not observed"]
    drawn = canvas(2.4 + 0.42 * len(columns), 1.6 + 0.36 * len(rows))
    axes = drawn.subplots()
    axes.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    axes.set_xticks(range(len(columns)), [names[c] for c in columns], rotation=90, fontsize=8)
    axes.set_yticks(range(len(rows)), [f"{names[r]} ({points[r]:,})" for r in rows], fontsize=8)
    axes.set_xlabel("label given, % of the true class", fontsize=9)
    axes.set_ylabel("true class (points)", fontsize=9)
    axes.tick_params(length=0)
    for i, j in np.argwhere(share >= _LEAST_SHARE):
        ink = "white" if share[i, j] > 0.6 else "black"
        axes.text(j, i, f"{100 * share[i, j]:.0f}", ha="center", va="center", fontsize=7, color=ink)
    caption = "Confusion: of the points of each true class, the share in percent that was given each label."
    return Figure("confusion", caption, png(drawn))


def reliability_diagram(diagram: Reliability) -> Figure:
    """Draw how often the most probable class was right, by its probability.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    drawn = canvas(3.6, 3.6)
    axes = drawn.subplots()
    draw_reliability(axes, diagram)
    axes.tick_params(labelsize=8)
    axes.set_xlabel(CONFIDENCE, fontsize=9)
    axes.set_ylabel(ACCURACY, fontsize=9)
    caption = "Reliability: how often the most probable class was right, by its probability."
    return Figure("reliability", caption, png(drawn))


def draw_reliability(axes: Axes, diagram: Reliability) -> None:
    """Draw accuracy against confidence, dots larger the more points they stand for, and the share of points."""
    filled = diagram.count > 0
    said, right = diagram.confidence[filled], diagram.accuracy[filled]
    share = diagram.count / diagram.count.sum()
    axes.stairs(share, diagram.edges, fill=True, color="#dfe3e8")
    axes.plot([0, 1], [0, 1], color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.vlines(said, said, right, color=RED, linewidth=1.6)
    axes.plot(said, right, color=BLUE, linewidth=1)
    axes.scatter(said, right, s=8 + 60 * share[filled], color=BLUE, zorder=3, clip_on=False)
    axes.text(0.05, 0.92, f"ECE {diagram.ece:.3f}", fontsize=8, va="top", backgroundcolor="#ffffffcc")
    axes.set(xlim=(0, 1), ylim=(0, 1), xticks=(0, 0.5, 1), yticks=(0, 0.5, 1), aspect="equal")
