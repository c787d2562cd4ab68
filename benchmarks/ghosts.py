"""Ghosts of moving objects in the map of a SemanticKITTI sequence, with and without forgetting.

    uv run benchmarks/ghosts.py DATA/semantickitti_08

Moving objects are those whose raw ids in the truth are 252 to 259. A ghost is a place where one was in an earlier
scan, half a metre or more from every moving object of the last scan, and of which the map of all scans says that
something is there, of a class that moves. The mIoU is over the truly labelled points that do not move.
"""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from semgp.evaluation.scores import score
from semgp.evaluation.semantic_kitti import VERTICAL, kitti_sequence
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace, occupancy_model
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR, with_vertical
from semgp.prediction import FREE

MOVERS = ("car", "truck", "other-vehicle", "person", "bicyclist", "motorcyclist", "bicycle", "motorcycle")
CLEAR = 0.5


def moving(folder: Path) -> list[NDArray[np.bool_]]:
    """Return which points of each scan belong to moving objects."""
    raw = (np.fromfile(path, "<u4") & 0xFFFF for path in sorted((folder / "labels").glob("*.label")))
    return [(ids >= 252) & (ids <= 259) for ids in raw]


def main(folder: Path) -> None:
    sequence = kitti_sequence(folder)
    scans = [sequence.scan(i, "predictions") for i in range(len(sequence))]
    truth = [sequence.scan(i) for i in range(len(sequence))]
    masks = moving(folder)
    last = KDTree(truth[-1].points[masks[-1]])
    places = np.concatenate([c.points[m] for c, m in zip(truth[:-1], masks)])
    places = places[last.query(places)[0] > CLEAR]
    static = np.concatenate([c.points[~m & c.labelled] for c, m in zip(truth, masks)])
    labels = np.concatenate([c.hard_labels[~m & c.labelled] for c, m in zip(truth, masks)])
    classes, model = scans[0].classes, with_vertical(OUTDOOR_LIDAR, VERTICAL)
    movers = [classes.index(name) for name in MOVERS]
    free = FreeSpace(occupancy_model(model.resolution, VERTICAL))
    maps = {
        "labels alone": GPSemanticMap(classes, model),
        "free space": GPSemanticMap(classes, model, free=free),
        **{
            f"half-life {h} scans": GPSemanticMap(classes, model, free=free, forgetting=Forgetting(h))
            for h in (3.0, 30.0)
        },
        "half-life 30 scans, passed 0.3": GPSemanticMap(
            classes, model, free=free, forgetting=Forgetting(30.0, passed=0.3)
        ),
    }
    print(f"{len(places):,} places where something moved, {len(static):,} points that did not")
    print("| map | ghosts | share | static mIoU % | accuracy % | NLL | update + solve, s |")
    print("|---|---|---|---|---|---|---|")
    for name, gp in maps.items():
        start = perf_counter()
        for cloud in scans:
            gp.update(cloud)
            gp.solve()
        seconds = perf_counter() - start
        answer = gp.query(places)
        there = answer.observed if answer.occupancy is None else answer.observed & (answer.occupancy.state != FREE)
        ghosts = int(np.count_nonzero(there & np.isin(answer.label, movers)))
        right = gp.query(static)
        s = score(right.probability, right.observed, labels)
        print(
            f"| {name} | {ghosts:,} | {ghosts / len(places):.3f} | {100 * s.miou:.2f} | {100 * s.accuracy:.2f} "
            f"| {s.nll:.3f} | {seconds:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
