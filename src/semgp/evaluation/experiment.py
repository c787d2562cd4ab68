"""An experiment: every method on every task, and, where asked for, the report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from semgp.evaluation.curves import cost_figure, reliability_figure
from semgp.evaluation.figures import Figure, MapRow, map_row, maps_figure
from semgp.evaluation.report import write_report
from semgp.evaluation.room import stanford_figure
from semgp.evaluation.task import Method, Result, Task, run
from semgp.picture import View

SHOWN = ("octomap", "bki", "gpsm")
"""Methods whose maps are drawn, the last one with its uncertainty."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """Results of all methods on all tasks, and a row of pictures for each task that was drawn."""

    results: list[Result] = field(default_factory=list)
    rows: list[MapRow] = field(default_factory=list)


def run_experiment(
    tasks: Iterable[Task],
    methods: Mapping[str, Method],
    on_step: Callable[[str, str], None] = lambda task, method: None,
    view: Callable[[Task], View] | None = None,
    disc_scale: float = 1.0,
) -> Experiment:
    """Run every method on every task.

    Maps and predictions are let go after each task: whole experiments would not fit into memory.

    Parameters
    ----------
    tasks : iterable of Task
        The scenes.
    methods : mapping of str to Method
        The methods by name.
    on_step : callable, optional
        Called with the names of task and method before each.
    view : callable, optional
        Gives the view from which a task's maps are drawn; left out, none are.
    disc_scale : float, optional
        Size of the discs that stand for points; see `map_row`.
    """
    experiment = Experiment()
    for task in tasks:
        results = []
        for name, method in methods.items():
            on_step(f"{task.name}, {task.experiment}", name)
            results.append(run(task, name, method))
        if view is not None:
            on_step(f"{task.name}, {task.experiment}", "drawing")
            shown = sorted((r for r in results if r.method in SHOWN), key=lambda r: SHOWN.index(r.method))
            experiment.rows.append(map_row(task, shown or results[-1:], view(task), disc_scale))
        experiment.results.extend(replace(r, prediction=None, semantic_map=None) for r in results)
    return experiment


def report(
    folder: Path,
    experiment: Experiment,
    title: str,
    settings: Mapping[str, object],
    command: str,
    room: Path | None,
) -> Path:
    """Write the report of an experiment: maps, reliability, costs, and the OctoMap of a Stanford room if given."""
    figures: list[Figure] = [maps_figure(experiment.rows)] if experiment.rows else []
    figures.append(reliability_figure(experiment.results))
    figures.append(cost_figure(experiment.results))
    if room is not None:
        figures.append(stanford_figure(room))
    seed = settings["seed"]
    assert isinstance(seed, int)
    return write_report(
        folder,
        experiment.results,
        figures,
        title=title,
        settings=settings,
        seed=seed,
        command=command,
        classes=experiment.rows[0].classes if experiment.rows else None,
    )
