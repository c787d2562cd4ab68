"""Which settings matter: one setting of a block model changed at a time, and what that does to the scores.

    uv run benchmarks/settings.py [DATA/semantickitti_08]

Three views of a synthetic room with sparse, partly wrong labels make a map that is asked at what a fourth view
truly sees; means over three rooms, starting from the preset "general". With a folder, ten SemanticKITTI scans with
a network's labels, asked at every truly labelled point, starting from "outdoor-lidar". Prints tables in
Markdown; seconds are those of the machine that runs it, after a first run that compiles.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from semgp.blocks.model import BlockModel
from semgp.evaluation.semantic_kitti import VERTICAL, kitti_sequence, kitti_task
from semgp.evaluation.task import Result, Task, of_all_solved, run
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL, OUTDOOR_LIDAR, with_vertical
from semgp.scene.scan import synthetic_room

ROOMS = (11, 12, 13)  # not those that the preset was learned from
VIEWS, ASKED = (0, 2, 4), 1
SLOW = ("dirichlet", "laplace", "ep", "softmax")


def scaled(model: BlockModel, ell: float = 1.0, sf: float = 1.0) -> BlockModel:
    """Return the model with its length scales and signal deviations multiplied."""
    theta, at = np.array(model.kernel.theta), 0
    for term in model.terms:
        theta[at : at + len(term.ell)] += np.log(ell)
        theta[at + len(term.ell)] += np.log(sf)
        at += len(term.ell) + 1
    return replace(model, kernel=model.kernel.with_theta(theta))


def settings(base: BlockModel, posteriors: Sequence[str]) -> Mapping[str, BlockModel]:
    """Return models by what is changed in them."""
    r = base.resolution
    return {
        "as it is": base,
        **{f"resolution {100 * k * r:g} cm": replace(base, resolution=k * r) for k in (0.5, 2, 4)},
        **{f"length scales x {k:g}": scaled(base, ell=k) for k in (0.25, 0.5, 2, 4)},
        **{f"signal deviations x {k:g}": scaled(base, sf=k) for k in (0.5, 2)},
        **{f"noise s_n x {k:g}": replace(base, s_n=k * base.s_n) for k in (0.1, 10)},
        **{f"nugget x {k:g}": replace(base, nugget=k * base.nugget) for k in (0.1, 10)},
        **{
            f"members {leaf} + {near} + {far}": replace(base, leaf=leaf, near=near, far=far)
            for leaf, near, far in ((16, 8, 24), (32, 8, 24), (128, 8, 24), (64, 0, 0), (64, 32, 24), (64, 8, 96))
        },
        "no blending": replace(base, blend=0.01),
        **{f"posterior {name}": replace(base, posterior=name, weights=None) for name in posteriors},
    }


def room_task(seed: int) -> Task:
    room = synthetic_room(seed)
    training = tuple(room.scan(view).observed for view in VIEWS)
    return Task(f"room {seed}", "settings", training, room.scan(ASKED).truth[::5])


def measured(task: Task, name: str, model: BlockModel) -> Result:
    return run(task, name, lambda t: of_all_solved(GPSemanticMap(t.truth.classes, model), t, 0.0))


def table(title: str, tasks: Sequence[Task], models: Mapping[str, BlockModel]) -> None:
    measured(tasks[0], "compiled", models["as it is"])
    print(f"\n{title}\n")
    print("| setting | accuracy % | mIoU % | NLL | ECE | build s | query s |\n|---|---|---|---|---|---|---|")
    for name, model in models.items():
        results = [measured(task, name, model) for task in tasks]
        accuracy, miou, nll, ece = np.mean(
            [(r.scores.accuracy, r.scores.miou, r.scores.nll, r.scores.ece) for r in results], axis=0
        )
        build, query = np.mean([(r.fit_seconds, r.query_seconds) for r in results], axis=0)
        scores = f"{100 * accuracy:.1f} | {100 * miou:.1f} | {nll:.3f} | {ece:.3f}"
        print(f"| {name} | {scores} | {build:.2f} | {query:.2f} |", flush=True)


def main(folder: Path | None) -> None:
    rooms = [room_task(seed) for seed in ROOMS]
    n_asked = np.mean([len(task.truth) for task in rooms])
    labels = np.mean([sum(int(c.labelled.sum()) for c in task.training) for task in rooms])
    title = f"Synthetic rooms: {labels:,.0f} labels, {n_asked:,.0f} points asked"
    table(title, rooms, settings(GENERAL, ("indicator", "log-ratio", "vote", *SLOW)))
    if folder is not None:
        street = kitti_task(kitti_sequence(folder))
        base = with_vertical(OUTDOOR_LIDAR, VERTICAL)
        given = sum(int(c.labelled.sum()) for c in street.training)
        title = f"SemanticKITTI: {given:,} labels of a network, {len(street.truth):,} points asked"
        table(title, [street], settings(base, ("indicator", "log-ratio", "vote", "dirichlet")))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
