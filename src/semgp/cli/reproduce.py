"""`semgp reproduce`: the experiments of the paper, and those on SemanticKITTI, as commands."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cyclopts import App

from semgp.cli.options import JsonOut

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from semgp.evaluation.task import Method, Result, Task

reproduce = App(name="reproduce", help="Run the experiments of the paper on real data and print their tables.")

COLUMNS = (
    *("frame", "method", "auc", "accuracy", "miou", "nll", "ece", "coverage"),
    *("n_train", "n_query", "fit_seconds", "query_seconds", "peak_rss_mb"),
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
    json: JsonOut = None,
    quiet: bool = False,
) -> None:
    """Run the paper's experiments on NYU Depth V2.

    Example: semgp reproduce nyu nyu_depth_v2_labeled.mat --methods gpsm,gpsm-averaged,knn

    Parameters
    ----------
    data
        The official nyu_depth_v2_labeled.mat, or a folder of NNNN_depth_mm.png, NNNN_rgb.jpg, NNNN_label13.png.
    experiment
        "sparse": true labels on every third row and column. "noisy": the labels of a segmentation network.
    frames
        Frame numbers, from 1, with commas between; the default is the paper's four.
    methods
        Names with commas between: gpsm, gpsm-averaged, knn, knn-all, 1nn-all, knn-256, octomap, csm, bki.
    soft
        The network's class probabilities instead of its hard labels; noisy experiment only.
    classes
        NYU13 or NYU40 classes.
    seed
        Seed of the training subset and of all that the methods draw.
    json
        Write the rows to this file, or to standard output with "-".
    quiet
        Show no progress and no table.
    """
    from semgp.cli.console import write_json
    from semgp.evaluation.nyu import METHODS, nyu_task
    from semgp.readers import open_nyu

    chosen = _choose(methods, METHODS)
    source = open_nyu(data)
    tasks = (nyu_task(source.read(f, classes), experiment, soft, seed) for f in _numbers(frames))
    results = list(_run(tasks, chosen, quiet))
    settings = {"experiment": experiment, "soft": soft, "classes": classes, "seed": seed}
    _print(f"NYU Depth V2, {experiment} labels, {classes} classes", results, quiet or str(json) == "-")
    write_json(json, {**settings, "rows": [result.row() for result in results]})


def _run(tasks: Iterator[Task], methods: Mapping[str, Method], quiet: bool) -> Iterator[Result]:
    """Yield the result of every method on every task, with progress."""
    from semgp.cli.console import progress
    from semgp.evaluation.task import run

    with progress(quiet) as bars:
        bar = bars.add_task("", total=None)
        for task in tasks:
            for name, method in methods.items():
                bars.update(bar, description=f"{task.name}: {name}")
                yield run(task, name, method)


def _print(title: str, results: list[Result], quiet: bool) -> None:
    """Print the table, with each method's mean over the frames below."""
    from semgp.cli.console import STDOUT, score_table

    if quiet:
        return
    rows = [result.row() for result in results]
    means = [_mean(name, rows) for name in dict.fromkeys(row["method"] for row in rows)]
    STDOUT.print(score_table(title, rows + (means if len(rows) > len(means) else []), COLUMNS))


def _mean(method: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the mean row of a method."""
    mine = [row for row in rows if row["method"] == method]
    numbers = {name: sum(row[name] for row in mine) / len(mine) for name in COLUMNS[2:]}
    return {"frame": "mean", "method": method} | numbers | {n: round(numbers[n]) for n in ("n_train", "n_query")}


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


def _numbers(text: str) -> list[int]:
    """Return the whole numbers of a comma-separated list.

    Raises
    ------
    InputError
        Something else than whole numbers.
    """
    from semgp.errors import InputError

    try:
        return [int(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"frames must be whole numbers with commas between, not {text!r}.") from error
