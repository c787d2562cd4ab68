"""Maps of two halves of a SemanticKITTI sequence, fused, or asked as a committee, against the map of all scans.

    uv run benchmarks/map_fusion.py DATA/semantickitti_08

The halves a and b are every other scan, or the first and the second half. "turned" is a frame of its own, turned
by 30 degrees about the vertical and shifted by some metres, in which b is built before it is fused or joins the
committee; the map of all scans in that frame tells how much the grid alone decides. All maps are asked at every
truly labelled point. Seconds are those of building (halves), fusing (fused maps) and solving, and of the query.
Changes are the largest and the mean difference from the map of all scans, of class probabilities and of occupancy,
and "occupied" is the share of the points, all of them on surfaces, of which a map says so.
"""

import sys
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from semgp.cloud import LabelledCloud
from semgp.evaluation.displaced import moved
from semgp.evaluation.measure import timed
from semgp.evaluation.scores import score
from semgp.evaluation.semantic_kitti import VERTICAL, kitti_sequence, kitti_task
from semgp.maps.committee import Committee
from semgp.maps.free_space import FreeSpace, occupancy_model
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from semgp.maps.pooling import Weights
from semgp.maps.presets import OUTDOOR_LIDAR, with_vertical
from semgp.prediction import OCCUPIED, Prediction

MODEL = with_vertical(OUTDOOR_LIDAR, VERTICAL)
WEIGHTS: tuple[Weights, ...] = ("robust", "one")
FREE = FreeSpace(occupancy_model(MODEL.resolution, VERTICAL))


def built(scans: list[LabelledCloud]) -> GPSemanticMap:
    gp = GPSemanticMap(scans[0].classes, MODEL, free=FREE)
    for cloud in scans:
        gp.update(cloud)
    return gp


def frame() -> NDArray[np.float64]:
    T_a_b = np.eye(4)
    T_a_b[:3, :3] = Rotation.from_rotvec(np.radians(30) * np.eye(3)[VERTICAL]).as_matrix()
    T_a_b[:3, 3] = 4.321, -0.765, 12.34
    return T_a_b


def main(folder: Path) -> None:
    task = kitti_task(kitti_sequence(folder))
    truth, scans, T_a_b = task.truth[task.truth.labelled], list(task.training), frame()
    print(f"{len(scans)} scans, {len(truth):,} truly labelled points")
    print(
        "| map | mIoU % | accuracy % | ECE | NLL | coverage % | build, s | query, s | classes: max, mean change "
        "| occupancy: max, mean change | occupied % |\n|---|---|---|---|---|---|---|---|---|---|---|"
    )
    everything: Prediction | None = None

    def row(name: str, gp: GPSemanticMap | Committee, built_in: float, points: NDArray[np.float64]) -> None:
        nonlocal everything
        start = perf_counter()
        if isinstance(gp, GPSemanticMap):
            gp.solve()
        solved = perf_counter()
        answer = gp.query(points)
        asked = perf_counter()
        s = score(answer.probability, answer.observed, truth.hard_labels)
        everything = everything or answer
        assert answer.occupancy is not None
        assert everything.occupancy is not None
        d = np.abs(answer.probability - everything.probability)
        o = np.abs(answer.occupancy.probability - everything.occupancy.probability)
        print(
            f"| {name} | {100 * s.miou:.2f} | {100 * s.accuracy:.2f} | {s.ece:.4f} | {s.nll:.4f} "
            f"| {100 * s.coverage:.2f} | {built_in + solved - start:.2f} | {asked - solved:.2f} "
            f"| {d.max():.2g}, {d.mean():.2g} | {o.max():.2g}, {o.mean():.2g} "
            f"| {100 * (answer.occupancy.state == OCCUPIED).mean():.2f} |",
            flush=True,
        )

    T_b_a: NDArray[np.float64] = np.asarray(np.linalg.inv(T_a_b), dtype=np.float64)
    everywhere, turned = truth.points, [moved(cloud, T_b_a) for cloud in scans]
    row("all scans", *timed(partial(built, scans)), everywhere)
    row("all scans, turned", *timed(partial(built, turned)), moved(truth, T_b_a).points)
    n = len(scans) // 2
    for halves, first, second in (
        ("every other", slice(None, None, 2), slice(1, None, 2)),
        ("first, second", slice(n), slice(n, None)),
    ):
        a, a_seconds = timed(partial(built, scans[first]))
        b, b_seconds = timed(partial(built, scans[second]))
        b_turned = built(turned[second])
        row(f"{halves}: a alone", a, a_seconds, everywhere)
        row(f"{halves}: b alone", b, b_seconds, everywhere)
        row(f"{halves}: fused", *timed(partial(fuse, a, b)), everywhere)
        row(f"{halves}: fused, b turned", *timed(partial(fuse, a, b_turned, T_a_b)), everywhere)
        for weights in WEIGHTS:
            row(f"{halves}: committee, weights {weights}", Committee((a, b), weights=weights), 0.0, everywhere)
        both = Committee((a, b_turned), (np.eye(4), T_a_b))
        row(f"{halves}: committee, b turned", both, 0.0, everywhere)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
