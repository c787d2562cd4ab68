"""Seconds that the rival maps take to build from, and answer at, one depth-camera frame.

    uv run python benchmarks/baselines.py [--json] [--frame 282]

The map is built from the labels on every third row and column and asked at every labelled pixel. The frame is
one of NYU Depth V2, from $SEMGP_DATA or ../shared/data beside the checkout; where that is absent, a synthetic
corner of a room.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from semgp.baselines.bki import BKIMap
from semgp.baselines.csm import CSMMap
from semgp.baselines.knn import KNNMap
from semgp.camera import Pinhole, cloud_from_depth
from semgp.cloud import LabelledCloud
from semgp.conventions import NYU13
from semgp.evaluation.scores import score
from semgp.maps.protocol import SemanticMap
from semgp.readers.nyu import NYUFolder

DEFAULT_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--frame", type=int, default=282, help="number of the NYU frame")
    options = parser.parse_args()
    folder = Path(os.environ.get("SEMGP_DATA", DEFAULT_DATA)) / "nyu"
    if folder.is_dir():
        source, cloud = f"NYU frame {options.frame}", NYUFolder(folder).read(options.frame).cloud
    else:
        source, cloud = "synthetic corner", synthetic_corner()
    truth = cloud[cloud.labelled]
    sparse = truth[(np.asarray(truth.pixels) % 3 == 0).all(axis=1)]
    rows = [measure(name, sparse, truth) for name in rivals()]
    if options.json:
        counts = {"labels": len(sparse), "queries": len(truth)}
        print(json.dumps({"data": source, **counts, "rivals": rows}, indent=2))
    else:
        show(f"{source}: {len(sparse):,} labels, {len(truth):,} queries", rows)


def synthetic_corner() -> LabelledCloud:
    """Return a camera's view into the corner of three walls, each with patches of several classes."""
    camera = Pinhole(fx=520, fy=520, cx=320, cy=240)
    rays, _ = camera.back_project(np.ones((480, 640)))
    normals = np.array([[0.6, 0.0, 0.8], [-0.6, 0.0, 0.8], [0.0, 0.8, 0.6]])
    depths = 3 / np.maximum(rays @ normals.T, 0.1)
    depth, wall = depths.min(axis=2), depths.argmin(axis=2)
    patch = np.floor(rays * depth[..., None] @ np.array([1.7, 2.3, 1.1])).astype(np.int32)
    return cloud_from_depth(depth, camera, NYU13, labels=(patch + 4 * wall) % len(NYU13))


def rivals() -> dict[str, SemanticMap]:
    """Return the rivals, empty, with the settings of the NYU tables."""
    return {
        "1-NN": KNNMap(NYU13, k=1),
        "8-NN": KNNMap(NYU13, k=8, width=0.02),
        "S-CSM 2 cm": CSMMap(NYU13, resolution=0.02),
        "S-BKI 2 cm, ell 0.1": BKIMap(NYU13, resolution=0.02, ell=0.1),
        "S-BKI as published": BKIMap(NYU13),
    }


def measure(name: str, sparse: LabelledCloud, truth: LabelledCloud) -> dict[str, Any]:
    """Build, query and score one rival, after a first round on a few points that compiles everything."""
    first = rivals()[name]
    first.update(sparse[np.arange(100)])
    first.query(truth.points[:100])
    rival = rivals()[name]
    began = time.perf_counter()
    rival.update(sparse)
    rival.query(truth.points[:1])  # search trees are built when first needed: that is building, too
    built = time.perf_counter()
    answer = rival.query(truth.points)
    answered = time.perf_counter()
    scores = score(answer.probability, answer.observed, truth.hard_labels)
    return {
        "rival": name,
        "build_s": built - began,
        "query_s": answered - built,
        "score_s": time.perf_counter() - answered,
        "auc": scores.auc_total,
        "miou": scores.miou,
        **rival.info(),
    }


def show(title: str, rows: list[dict[str, Any]]) -> None:
    table = Table(title=title)
    for heading in ("rival", "build s", "query s", "score s", "AUC", "mIoU", "stored", "MB"):
        table.add_column(heading, justify="left" if heading == "rival" else "right")
    for row in rows:
        seconds = (f"{row[name]:.3f}" for name in ("build_s", "query_s", "score_s"))
        stored = f"{row.get('points', row.get('voxels')):,}"
        megabytes = f"{row['memory_bytes'] / 1e6:.1f}"
        table.add_row(row["rival"], *seconds, f"{row['auc']:.4f}", f"{row['miou']:.4f}", stored, megabytes)
    Console().print(table)


if __name__ == "__main__":
    main()
