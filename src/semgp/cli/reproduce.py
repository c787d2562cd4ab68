"""`semgp reproduce`: the experiments of the paper, and those on SemanticKITTI, as commands."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cyclopts import App

if TYPE_CHECKING:
    from semgp.evaluation.experiment import Experiment
    from semgp.evaluation.task import Method

reproduce = App(name="reproduce", help="Run the experiments of the paper on real data and print their tables.")

COLUMNS = (
    *("frame", "method", "auc", "accuracy", "miou", "nll", "ece", "coverage"),
    *("n_train", "learn_seconds", "fit_seconds", "query_seconds", "peak_rss_mb"),
)


@reproduce.command
def nyu(
    data: Path,
    /,
    *,
    experiment: Literal["sparse", "noisy"] = "sparse",
    frames: str = "282,374,555,965",
    methods: str = "gpsm,knn",
    soft: bool = False,
    classes: Literal[13, 40] = 13,
    seed: int = 0,
    report: Path | None = None,
    room: Path | None = None,
) -> None:
    """Run the paper's experiments on NYU Depth V2.

    Example: semgp reproduce nyu nyu_depth_v2_labeled.mat --methods gpsm,gpsm-averaged,knn,octomap

    Parameters
    ----------
    data
        The official nyu_depth_v2_labeled.mat, or a folder of NNNN_depth_mm.png, NNNN_rgb.jpg, NNNN_label13.png.
    experiment
        "sparse": true labels on every third row and column. "noisy": the labels of a segmentation network.
    frames
        Frame numbers, from 1, with commas between; the default is the paper's four.
    methods
        Names with commas between: blocks, vote, gpsm, gpsm-averaged, knn, knn-all, 1nn-all, knn-256, octomap, csm,
        bki. The first two learn their models from eight other frames of the data set.
    soft
        The network's class probabilities instead of its hard labels; noisy experiment only.
    classes
        NYU13 or NYU40 classes.
    seed
        Seed of the training subset and of all that the methods draw.
    report
        Write a report into this folder: tables with the paper's numbers beside ours, maps, curves, settings.
    room
        Folder of a labelled Stanford 2D-3D-S room (.pcd pieces), whose OctoMap the report shows, too.
    """
    from semgp.evaluation.figures import camera_view
    from semgp.evaluation.nyu import nyu_task
    from semgp.evaluation.nyu_blocks import NYUBlocks
    from semgp.readers import open_nyu

    source = open_nyu(data)
    chosen = _choose(methods, NYUBlocks(source, classes, seed).methods())
    numbers = _numbers("frames", frames, int)
    tasks = (nyu_task(source.read(f, classes), experiment, soft, seed) for f in numbers)
    view = (lambda task: camera_view(task.truth)) if report else None
    settings = {"experiment": experiment, "soft": soft, "classes": classes, "seed": seed}
    title = f"NYU Depth V2, {experiment} labels{', soft' if soft else ''}, {classes} classes"
    _finish(_run(tasks, len(numbers), chosen, view=view), title, settings, report, room)


@reproduce.command
def semantickitti(
    data: Path,
    /,
    *,
    keep: str = "1.0,0.01,0.002",
    methods: str = "csm,bki,knn",
    scans: int = 10,
    seed: int = 0,
    report: Path | None = None,
) -> None:
    """Map a network's labels of SemanticKITTI scans, and score at every truly labelled point.

    Example: semgp reproduce semantickitti sequences/08 --methods csm,bki,knn --keep 1.0,0.01

    Parameters
    ----------
    data
        A sequence: velodyne, labels, predictions, poses.txt, calib.txt.
    keep
        Shares of the points whose labels the map gets, with commas between.
    methods
        Names with commas between: blocks, vote, labels, csm, bki, bki-wide, knn, octomap.
    scans
        So many of the first scans.
    seed
        Seed of all that is drawn.
    report
        Write a report into this folder: tables with published numbers beside ours, maps, curves, settings.
    """
    from semgp.evaluation.figures import street_view
    from semgp.evaluation.semantic_kitti import METHODS, kitti_sequence, kitti_task

    chosen = _choose(methods, METHODS)
    sequence = kitti_sequence(data)
    shares = _numbers("keep", keep, float)
    tasks = (kitti_task(sequence, share, seed, scans) for share in shares)
    view = (lambda task: street_view(task.truth)) if report else None
    ran = _run(tasks, len(shares), chosen, view=view, disc_scale=1.8)
    _finish(ran, "SemanticKITTI", {"scans": scans, "seed": seed}, report, None)


def _run(tasks: Iterable[Any], n_tasks: int, methods: Mapping[str, Method], **drawing: Any) -> Experiment:
    """Run an experiment with progress."""
    from semgp.cli.console import progress
    from semgp.evaluation.canvas import require_matplotlib
    from semgp.evaluation.experiment import run_experiment

    if drawing.get("view") is not None:
        require_matplotlib()
    with progress() as bars:
        bar, done = bars.add_task("", total=n_tasks * len(methods)), count()

        def step(task: str, method: str) -> None:
            bars.update(bar, description=f"{task}: {method}", completed=next(done))

        return run_experiment(tasks, methods, step, **drawing)


def _finish(
    experiment: Experiment, title: str, settings: dict[str, Any], folder: Path | None, room: Path | None
) -> None:
    """Show the tables, with each method's mean over the frames, and write the report that was asked for."""
    from semgp.cli.console import STDOUT, report, score_table
    from semgp.evaluation import experiment as experiments

    rows = [result.row() for result in experiment.results]
    for name in dict.fromkeys(row["experiment"] for row in rows):
        of_name = [row for row in rows if row["experiment"] == name]
        means = [_mean(method, of_name) for method in dict.fromkeys(row["method"] for row in of_name)]
        shown = of_name + (means if len(of_name) > len(means) else [])
        STDOUT.print(score_table(f"{title}: {name}", shown, COLUMNS))
    page, words = None, f"{len(rows)} rows; --json gives them to programs, --report FOLDER writes a page"
    if folder is not None:
        command = " ".join(["semgp", *sys.argv[1:]])
        page = experiments.report(folder, experiment, title, settings, command, room)
        words = f"{page}: open it in a browser"
    report(words, **settings, rows=rows, report=page)


def _mean(method: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the mean row of a method."""
    mine = [row for row in rows if row["method"] == method]
    numbers = {name: sum(row[name] for row in mine) / len(mine) for name in COLUMNS[2:]}
    return {"frame": "mean", "method": method} | numbers


def _choose(names: str, known: Mapping[str, Method]) -> dict[str, Method]:
    """Return the methods of a comma-separated list.

    Raises
    ------
    InputError
        A name that is not known.
    """
    from semgp.errors import InputError

    chosen = [name.strip() for name in names.split(",") if name.strip()]
    unknown = [name for name in chosen if name not in known]
    if unknown or not chosen:
        raise InputError(f"no method is called {', '.join(unknown) or 'so'}; choose from {', '.join(known)}.")
    return {name: known[name] for name in chosen}


def _numbers(name: str, text: str, kind: type[int] | type[float]) -> list[Any]:
    """Return the numbers of a comma-separated list.

    Raises
    ------
    InputError
        Something else than such numbers.
    """
    from semgp.errors import InputError

    try:
        return [kind(part) for part in text.split(",")]
    except ValueError as error:
        sort = "whole numbers" if kind is int else "numbers"
        raise InputError(f"--{name} must be {sort} with commas between, not {text!r}.") from error
