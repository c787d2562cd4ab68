"""Curves of an experiment: how far its probabilities can be believed, and what its maps cost."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.evaluation.calibration import Reliability
from semgp.evaluation.canvas import canvas, png
from semgp.evaluation.diagrams import ACCURACY, CONFIDENCE, draw_reliability
from semgp.evaluation.figures import Figure
from semgp.evaluation.names import method_name
from semgp.evaluation.task import Result

if TYPE_CHECKING:
    from matplotlib.axis import Axis

_MARKERS = "osD^vP*Xhd<>"


def reliability_figure(results: Sequence[Result]) -> Figure:
    """Draw a reliability diagram for each method, its points of all scenes taken together.

    Several experiments have a row each.

    Parameters
    ----------
    results : sequence of Result
        At least one.

    Raises
    ------
    InputError
        No results.
    MissingExtraError
        matplotlib is not installed.
    """
    methods = _by_method(results)
    experiments = list(dict.fromkeys(result.experiment for result in results))
    cells = [(experiment, method) for experiment in experiments for method in methods]
    columns = len(methods) if len(experiments) > 1 else min(4, len(methods))
    rows = math.ceil(len(cells) / columns)
    drawn = canvas(2.3 * columns + 0.4, 2.45 * rows + 0.4)
    grid = drawn.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for i, ((experiment, method), axes) in enumerate(zip(cells, grid.flat)):
        axes.tick_params(labelsize=8, labelbottom=i + columns >= len(cells))
        if diagrams := [r.scores.reliability for r in methods[method] if r.experiment == experiment]:
            axes.set_axis_on()
            axes.set_title(f"{method_name(method)}, {experiment}", fontsize=9)
            draw_reliability(axes, pooled(diagrams))
    drawn.supxlabel(CONFIDENCE, fontsize=9)
    drawn.supylabel(ACCURACY, fontsize=9)
    caption = (
        "Reliability: how often the most probable class was right, by its probability, over the points of all "
        "scenes. Dots grow with the share of points that they stand for, which the grey bars show; red lines are "
        "the gaps that ECE averages. An answer withheld is wrong, with probability zero."
    )
    return Figure("reliability", caption, png(drawn))


def pooled(diagrams: Sequence[Reliability]) -> Reliability:
    """Return the diagram of all points of several diagrams with the same bins."""
    count = np.sum([d.count for d in diagrams], axis=0)

    def mean(field: str) -> NDArray[np.float64]:
        total = np.sum([np.nan_to_num(getattr(d, field)) * d.count for d in diagrams], axis=0)
        return np.asarray(np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0))

    return Reliability(diagrams[0].edges, count, mean("confidence"), mean("accuracy"))


def cost_figure(results: Sequence[Result]) -> Figure:
    """Draw seconds to build and to query against the number of labels, and what they buy: mIoU against seconds.

    Each point is the mean of a method over the scenes of an experiment, of which there may be several. Errors as
    `reliability_figure`.
    """
    methods = _by_method(results)
    drawn = canvas(10, 3.7)
    build, query, worth = drawn.subplots(1, 3)
    for i, (method, of_method) in enumerate(methods.items()):
        labels, fit, ask, miou = np.array(sorted(_costs(of_method))).T
        style: dict[str, Any] = {"marker": _MARKERS[i % len(_MARKERS)], "color": f"C{i % 10}", "linewidth": 1}
        build.plot(labels, fit, label=method_name(method), **style)
        query.plot(labels, ask, **style)
        worth.plot(fit + ask, miou, **style | {"linestyle": "none"})
    for axes, x, y in (
        (build, "labels", "seconds to build"),
        (query, "labels", "seconds to query 100,000 points"),
        (worth, "seconds to build, and to query 100,000 points", "mIoU"),
    ):
        axes.set_xlabel(x, fontsize=9)
        axes.set_title(y, fontsize=9)
        axes.grid(True, which="major", linewidth=0.4, color="#d9dce1")
        axes.tick_params(labelsize=8)
        axes.set_xscale("log")
        _by_decades(axes.xaxis)
    for axes in (build, query):
        axes.set_yscale("log")
        _by_decades(axes.yaxis)
    drawn.legend(loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    caption = (
        "Costs: seconds to build a map and to query it, by the number of labels, and the mIoU that they buy. Each "
        "point is a method's mean over the scenes of an experiment."
    )
    return Figure("costs", caption, png(drawn))


def _costs(results: Sequence[Result]) -> Iterator[tuple[float, ...]]:
    """Labels, seconds to build, seconds for 100,000 queries and mIoU, mean over each experiment's scenes."""
    for experiment in {result.experiment for result in results}:
        scenes = [result for result in results if result.experiment == experiment]
        costs = [
            (r.n_train, r.fit_seconds, r.query_seconds / r.scores.n_points * 1e5, r.scores.miou) for r in scenes
        ]
        yield tuple(np.mean(costs, axis=0))


def _by_decades(axis: Axis) -> None:
    """Let a logarithmic axis show whole decades, and label no others."""
    from matplotlib.ticker import LogLocator, NullFormatter

    low, high = np.log10(axis.get_data_interval())
    axis.set_view_interval(10 ** math.floor(low - 0.05), 10 ** math.ceil(high + 0.05), ignore=True)
    axis.set_major_locator(LogLocator(numticks=12))
    axis.set_minor_formatter(NullFormatter())


def _by_method(results: Iterable[Result]) -> dict[str, list[Result]]:
    """Results by method, in the order in which they come."""
    methods: dict[str, list[Result]] = {}
    for result in results:
        methods.setdefault(result.method, []).append(result)
    if not methods:
        raise InputError("there are no results to draw: run at least one method.")
    return methods
