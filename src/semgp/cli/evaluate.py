"""`semgp evaluate`: how good a map is, over all points and class by class."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semgp.cli.inputs import PLAIN, AnyInputs
from semgp.cli.places import require_place

if TYPE_CHECKING:
    from rich.table import Table

    from semgp.classes import Classes
    from semgp.evaluation.by_class import ClassScores
    from semgp.evaluation.scores import Scores

TOTALS = ("points", "coverage", "auc", "accuracy", "miou", "nll", "brier", "ece")
BY_CLASS = ("class", "points", "iou", "precision", "recall", "auc", "probability", "taken for")


def evaluate(map_file: Path, /, *, truth: Path, inputs: AnyInputs = PLAIN, figures: Path | None = None) -> None:
    """Score a map against points with true labels: over all points, and class by class.

    Example: semgp evaluate room.semgp --truth room-truth.ply

    Example: semgp evaluate room.semgp --truth room-truth.ply --figures scores

    Parameters
    ----------
    map_file
        A map that `semgp build` wrote.
    truth
        A point file or data set with true labels, of the map's classes.
    figures
        Draw the confusion matrix (confusion.png) and the reliability diagram (reliability.png) into this folder.
    """
    require_place(map_file, truth)

    import numpy as np
    from rich.console import Group

    from semgp.cli.console import progress, report, require_folder
    from semgp.cli.inputs import sources, tell_labels
    from semgp.cli.reading import in_classes
    from semgp.evaluation.by_class import by_class
    from semgp.evaluation.canvas import require_matplotlib
    from semgp.evaluation.scores import score
    from semgp.maps.batches import query_in_batches
    from semgp.maps.files import load_map

    if figures is not None:
        require_matplotlib()
    semantic_map = load_map(map_file)
    scans = sources([truth], inputs)
    clouds = (in_classes(cloud, semantic_map.classes, str(truth)) for cloud in scans)
    known = (cloud[cloud.labelled] for cloud in clouds)
    X, labels = map(np.concatenate, zip(*((cloud.points, cloud.hard_labels) for cloud in known)))
    tell_labels(scans)
    if figures is not None:
        require_folder(figures)
    with progress() as bars:
        asking = bars.add_task("asking the map", total=len(X))
        prediction = query_in_batches(semantic_map, X, lambda n, _: bars.update(asking, completed=n))
        scores = score(prediction.probability, prediction.observed, labels)
        rows = by_class(scores, semantic_map.classes)
        if figures is not None:
            _draw(scores, semantic_map.classes, figures)
    confusion, not_observed = scores.confusion[:, :-1], scores.confusion[:, -1]
    report(
        Group(_totals(scores, f"{map_file} against {truth}"), _by_class(rows)),
        **scores.to_json(),
        classes=[asdict(row) for row in rows],
        confusion=confusion,
        not_observed=not_observed,
        figures=figures,
    )


def _totals(scores: Scores, title: str) -> Table:
    from semgp.cli.console import score_table

    row = {"points": scores.n_points, "auc": scores.auc_total} | {n: getattr(scores, n, None) for n in TOTALS[3:]}
    return score_table(title, [row | {"coverage": scores.coverage}], TOTALS)


def _by_class(classes: list[ClassScores]) -> Table:
    """The classes that the truth has; below it, the others."""
    from semgp.cli.console import score_table

    rows: list[dict[str, Any]] = [
        asdict(c) | {"class": c.name, "taken for": _taken_for(c)} for c in classes if c.points
    ]
    table = score_table("by class", rows, BY_CLASS)
    absent = [f"{c.name} (given to {c.given:,} points)" if c.given else c.name for c in classes if not c.points]
    if absent:
        table.caption = f"not in the truth, and in no mean: {', '.join(absent)}"
    return table


def _taken_for(c: ClassScores) -> str:
    """The label that is given to this class's points by mistake, with the share of them."""
    return "-" if c.confused_with is None else f"{c.confused_with}, {c.confused / c.points:.1%}"


def _draw(scores: Scores, classes: Classes, folder: Path) -> None:
    from semgp.evaluation.diagrams import confusion_diagram, reliability_diagram
    from semgp.writers import atomic_write

    for figure in (confusion_diagram(scores.confusion, classes), reliability_diagram(scores.reliability)):
        with atomic_write(folder / f"{figure.name}.png") as temporary:
            temporary.write_bytes(figure.png)
