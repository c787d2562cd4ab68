"""Maps from scans whose poses are wrong, with and without knowing how wrong they may be.

    uv run benchmarks/pose_noise.py DATA/semantickitti_08

Each scan's pose is moved and turned at random. The map, built from a network's labels at the places where the
wrong poses put them, is asked at every truly labelled point at its right place. "ignored" takes the poses as
right, "known" passes the covariance of the errors on. The model is the preset, which knows nothing of pose errors,
or is learned from the same wrongly placed scans, once without and once with their covariances.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from semgp.blocks.learning import learn_from_scans
from semgp.evaluation.displaced import displaced
from semgp.evaluation.scores import Scores, score
from semgp.evaluation.semantic_kitti import START, VERTICAL, kitti_sequence, kitti_task
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR, with_vertical

LEVELS = ((0.1, 0.2), (0.2, 0.4), (0.3, 0.6), (0.5, 1.0))
"""Standard deviations of the errors: metres and degrees, along and about each axis."""


def main(folder: Path, seeds: Sequence[int]) -> None:
    task = kitti_task(kitti_sequence(folder))
    truth = task.truth[task.truth.labelled]
    print("| errors | model | poses | mIoU % | accuracy % | ECE | NLL |\n|---|---|---|---|---|---|---|")
    for metres, degrees in LEVELS:
        scored: dict[tuple[str, str], list[Scores]] = {}
        for seed in seeds:
            rng = np.random.default_rng(seed)
            known = [displaced(cloud, metres, degrees, rng) for cloud in task.training]
            for poses, scans in (("ignored", [replace(c, pose_covariance=None) for c in known]), ("known", known)):
                learned, _ = learn_from_scans(scans, with_vertical(START, VERTICAL), vertical=VERTICAL, seed=seed)
                for name, model in (("preset", with_vertical(OUTDOOR_LIDAR, VERTICAL)), ("learned", learned)):
                    gp = GPSemanticMap(truth.classes, model)
                    for cloud in scans:
                        gp.update(cloud)
                    answer = gp.query(truth.points)
                    s = score(answer.probability, answer.observed, truth.hard_labels)
                    scored.setdefault((name, poses), []).append(s)
        for (name, poses), all_scores in sorted(scored.items()):
            means = [np.mean([getattr(s, n) for s in all_scores]) for n in ("miou", "accuracy", "ece", "nll")]
            miou, accuracy, ece, nll = means
            print(
                f"| {metres} m, {degrees} deg | {name} | {poses} | {100 * miou:.2f} | {100 * accuracy:.2f} "
                f"| {ece:.4f} | {nll:.4f} |",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    arguments = parser.parse_args()
    main(arguments.folder, arguments.seeds)
