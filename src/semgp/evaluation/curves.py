"""Curves of an experiment: how far its probabilities can be believed, and what its maps cost."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError, MissingExtraError
from semgp.evaluation.calibration import Reliability
from semgp.evaluation.figures import Figure
from semgp.evaluation.names import method_name
from semgp.evaluation.task import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure as Canvas

DOTS_PER_INCH = 200
_BLUE, _RED, _GREY = "#3b6ea5", "#c8553d", "#8a8f98"
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
    canvas = _canvas(2.3 * columns + 0.4, 2.45 * rows + 0.4)
    grid = canvas.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for i, ((experiment, method), axes) in enumerate(zip(cells, grid.flat)):
        axes.tick_params(labelsize=8, labelbottom=i + columns >= len(cells))
        if diagrams := [r.scores.reliability for r in methods[method] if r.experiment == experiment]:
            axes.set_axis_on()
            axes.set_title(f"{method_name(method)}, {experiment}", fontsize=9)
            _draw_reliability(axes, pooled(diagrams))
    canvas.supxlabel("probability of the most probable class", fontsize=9)
    canvas.supylabel("share of right labels", fontsize=9)
    caption = (
        "Reliability: how often the most probable class was right, by its probability, over the points of all "
        "scenes. Dots grow with the share of points that they stand for, which the grey bars show; red lines are "
        "the gaps that ECE averages. An answer withheld is wrong, with probability zero."
    )
    return Figure("reliability", caption, _png(canvas))


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
    canvas = _canvas(10, 3.7)
    build, query, worth = canvas.subplots(1, 3)
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
    canvas.legend(loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    caption = (
        "Costs: seconds to build a map and to query it, by the number of labels, and the mIoU that they buy. Each "
        "point is a method's mean over the scenes of an experiment."
    )
    return Figure("costs", caption, _png(canvas))


def _draw_reliability(axes: Axes, diagram: Reliability) -> None:
    """Accuracy against confidence, dots the larger the more points they stand for, and the share of points."""
    filled = diagram.count > 0
    said, right = diagram.confidence[filled], diagram.accuracy[filled]
    share = diagram.count / diagram.count.sum()
    axes.stairs(share, diagram.edges, fill=True, color="#dfe3e8")
    axes.plot([0, 1], [0, 1], color=_GREY, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.vlines(said, said, right, color=_RED, linewidth=1.6)
    axes.plot(said, right, color=_BLUE, linewidth=1)
    axes.scatter(said, right, s=8 + 60 * share[filled], color=_BLUE, zorder=3, clip_on=False)
    axes.text(0.05, 0.92, f"ECE {diagram.ece:.3f}", fontsize=8, va="top", backgroundcolor="#ffffffcc")
    axes.set(xlim=(0, 1), ylim=(0, 1), xticks=(0, 0.5, 1), yticks=(0, 0.5, 1), aspect="equal")


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


def require_matplotlib() -> None:
    """Check that curves can be drawn, before an experiment whose report needs them is run.

    Raises
    ------
    MissingExtraError
        The extra `figures` is not installed.
    """
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("drawing curves", "figures") from error


def _canvas(width: float, height: float) -> Canvas:
    """An empty matplotlib figure of a size in inches, apart from pyplot and its state."""
    require_matplotlib()
    from matplotlib.figure import Figure as Canvas

    return Canvas(figsize=(width, height), dpi=DOTS_PER_INCH, layout="constrained")


def _png(canvas: Canvas) -> bytes:
    file = io.BytesIO()
    canvas.savefig(file, format="png")
    return file.getvalue()
