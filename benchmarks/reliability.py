"""What label reliability, learned without truth, does to the block map.

    uv run python benchmarks/reliability.py [--json] [--seeds 3] [--keep 1.0 0.01] [--no-nyu]

SemanticKITTI 08 (ten scans with a network's labels) and the four NYU frames, from $SEMGP_DATA or ../shared/data
beside the checkout. What the labels are given before they go into the map:

* range: confidence by a law of the range, `learn_range_confidence`;
* confusion: soft labels p(true | said), `learn_confusion` and `Confusion.apply`;
* class: confidence by the evidence of a label of each class, `Confusion.weigh`;
* diagonal: confidence p(said = c | true = c), the diagonal of the matrix.

Reliability is learned from the labels that the map gets, or, where these are few, from all labels of the scans
("by all labels"). The map's model is learned afresh from the adjusted labels of each row. Its judges are the same
clouds, but a judge's label is its hard one: with a confidence, as the network said it; with confusion, the most
probable true class, which is another for the share of labels in the column "other label". Means over seeds, and
the smallest and largest difference from the plain labels of the same seed.

No two of the NYU frames overlap: nothing can be learned from them without truth. Their confusion is counted on the
true labels of the eight other frames, from which the map's model is learned, too.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from semgp.blocks.draw import Trial
from semgp.blocks.learning import learn_blocks, learn_from_scans
from semgp.cloud import LabelledCloud
from semgp.evaluation.metrics import confusion as count_confusion
from semgp.evaluation.nyu import PAPER_FRAMES, nyu_task
from semgp.evaluation.nyu_blocks import LEARNING_FRAMES, class_prior
from semgp.evaluation.nyu_blocks import START as NYU_START
from semgp.evaluation.scores import Scores
from semgp.evaluation.semantic_kitti import START, VERTICAL, kitti_sequence, kitti_task
from semgp.evaluation.task import Task, of_all_solved, run
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import with_vertical
from semgp.readers.nyu import NYUFolder
from semgp.reliability.confusion import Confusion, learn_confusion
from semgp.reliability.ranges import learn_range_confidence

DEFAULT_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
METRICS = ("miou", "accuracy", "ece", "nll")
COMPARED = ("accuracy", "nll")
Adjust = Callable[[LabelledCloud], LabelledCloud]
Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--keep", type=float, nargs="+", default=[1.0, 0.01], help="shares of labels kept")
    parser.add_argument("--no-nyu", action="store_true", help="SemanticKITTI alone")
    options = parser.parse_args()
    data = Path(os.environ.get("SEMGP_DATA", DEFAULT_DATA))
    tables = {f"SemanticKITTI 08, keep {keep:g}": kitti(data, keep, options.seeds) for keep in options.keep}
    if not options.no_nyu:
        tables["NYU, network labels"] = nyu(data)
    if options.json:
        print(json.dumps(tables, indent=2))
        return
    for title, rows in tables.items():
        show(title, rows)


def kitti(data: Path, keep: float, seeds: int) -> list[Row]:
    """Return a row for each way to adjust the labels of a sequence."""
    sequence = kitti_sequence(data / "semantickitti_08")
    results: dict[str, list[Scores]] = {}
    changed: dict[str, list[float]] = {}
    for seed in range(seeds):
        task = kitti_task(sequence, keep, seed)
        ways = adjustments(task.training)
        if keep < 1:
            of_all = adjustments(kitti_task(sequence).training)
            ways |= {f"{name}, by all labels": way for name, way in of_all.items() if name != "plain"}
        for name, way in ways.items():
            adjusted = replace(task, training=tuple(way(cloud) for cloud in task.training))
            others = [np.mean(a.hard_labels != b.hard_labels) for a, b in zip(adjusted.training, task.training)]
            changed.setdefault(name, []).append(float(np.mean(others)))
            results.setdefault(name, []).append(kitti_scores(adjusted))
    return [{**row, "other label": float(np.mean(changed[row["labels"]]))} for row in summary(results)]


def adjustments(scans: Sequence[LabelledCloud]) -> dict[str, Adjust]:
    """Return the ways to adjust labels by name, with what these scans teach."""
    law, found = learn_range_confidence(scans), learn_confusion(scans)
    return {
        "plain": lambda cloud: cloud,
        "range": law.apply,
        "confusion": found.apply,
        "range, confusion": lambda cloud: found.apply(law.apply(cloud)),
        "class": found.weigh,
        "range, class": lambda cloud: found.weigh(law.apply(cloud)),
        "diagonal": lambda cloud: replace(cloud, confidence=found.matrix.diagonal()[cloud.hard_labels]),
    }


def kitti_scores(task: Task) -> Scores:
    """Learn a model from a task's scans, build the map, and score it."""
    start = with_vertical(START, VERTICAL)
    model, _ = learn_from_scans(task.training, start, vertical=VERTICAL, seed=task.seed)
    built = run(task, "blocks", lambda t: of_all_solved(GPSemanticMap(t.truth.classes, model), t, 0))
    return built.scores


def nyu(data: Path) -> list[Row]:
    """Return a row for each way to adjust the labels of the NYU frames: means over the frames."""
    source = NYUFolder(data / "nyu")
    learning = [nyu_task(source.read(frame), "noisy") for frame in LEARNING_FRAMES]
    scored = [nyu_task(source.read(frame), "noisy") for frame in PAPER_FRAMES]
    found = counted(learning)
    ways: dict[str, Adjust] = {"plain": lambda cloud: cloud, "confusion": found.apply, "class": found.weigh}
    results = {}
    for name, way in ways.items():
        trials: list[Trial] = [([way(cloud) for cloud in task.training], [task.truth]) for task in learning]
        start = replace(NYU_START["noisy"], prior=class_prior(trials, 0.5))
        model, _ = learn_blocks(trials, start, spread=1.0, max_iterations=15)
        tasks = [replace(task, training=tuple(way(cloud) for cloud in task.training)) for task in scored]
        results[name] = [
            run(task, name, lambda t, m=model: of_all_solved(GPSemanticMap(t.truth.classes, m), t, 0)).scores  # type: ignore[misc]
            for task in tasks
        ]
    return summary(results)


def counted(tasks: Sequence[Task]) -> Confusion:
    """Count what a network says against the truth, with one label more for each two classes."""
    classes = tasks[0].truth.classes
    C = len(classes)
    each = [count_confusion(t.training[0].hard_labels, t.truth.hard_labels, C)[:, :C] for t in tasks]
    counts = np.sum(each, axis=0) + 1.0
    return Confusion(classes, counts / counts.sum(axis=1, keepdims=True), counts.sum(axis=1) / counts.sum())


def summary(results: Mapping[str, Sequence[Scores]]) -> list[Row]:
    """Return means, and the extremes of the difference from the plain labels."""
    rows = []
    for name, scores in results.items():
        row: Row = {"labels": name} | {m: float(np.mean([getattr(s, m) for s in scores])) for m in METRICS}
        for metric in COMPARED:
            apart = [getattr(s, metric) - getattr(p, metric) for s, p in zip(scores, results["plain"])]
            row[f"{metric} - plain"] = f"{min(apart):+.4f} to {max(apart):+.4f}"
        rows.append(row)
    return rows


def show(title: str, rows: Sequence[Row]) -> None:
    table = Table(title=title)
    for name in rows[0]:
        table.add_column(name, justify="left" if name == "labels" else "right")
    for row in rows:
        table.add_row(*(f"{v:.4f}" if isinstance(v, float) else v for v in row.values()))
    Console(width=150).print(table)


if __name__ == "__main__":
    main()
