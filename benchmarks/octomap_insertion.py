"""Seconds and bytes that inserting one depth-camera frame takes here and in OctoMap, side by side.

    uv run python benchmarks/octomap_insertion.py [--json] [--frame 282] [--resolution 0.02] [--repeats 5]

Both insert the same 640 x 480 points, per ray and discretised, into an empty map; ours also averages the
labels and colours of every voxel. The frame is one of NYU Depth V2, from $SEMGP_DATA or ../shared/data beside
the checkout; where that is absent, a view of the synthetic room. "copying" is the part of octomap-python's time
in which it takes the points over from numpy, measured by inserting as many points that need no rays. The
exponent b is that of seconds = a * points^b, fitted to parts of the frame.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from semgp.cloud import LabelledCloud
from semgp.octomap import SemanticOctoMap
from semgp.parallel import n_workers
from semgp.readers.nyu import NYUFolder
from semgp.scene import DepthCamera, synthetic_room

DEFAULT_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
STRIDES = (1, 2, 4, 8, 16, 32)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--frame", type=int, default=282, help="number of the NYU frame")
    parser.add_argument("--resolution", type=float, default=0.02, help="edge of a voxel in metres")
    parser.add_argument("--repeats", type=int, default=5, help="the best of so many runs counts")
    options = parser.parse_args()
    source, cloud = frame(options.frame)
    modes = {"per ray": False, "discretised": True}
    rows = [
        {"mode": mode, **compare(cloud, options.resolution, discretize, options.repeats)}
        for mode, discretize in modes.items()
    ]
    growth = [
        {"mode": mode, **exponents(cloud, options.resolution, discretize)} for mode, discretize in modes.items()
    ]
    if options.json:
        facts = {"data": source, "points": len(cloud), "resolution": options.resolution, "threads": n_workers()}
        print(json.dumps({**facts, "insertion": rows, "exponent": growth}, indent=2))
    else:
        show(
            f"{source}: {len(cloud):,} points, {100 * options.resolution:g} cm, {n_workers()} threads",
            rows,
            growth,
        )


def frame(number: int) -> tuple[str, LabelledCloud]:
    """Return a name and a cloud with pose, labels and colours."""
    folder = Path(os.environ.get("SEMGP_DATA", DEFAULT_DATA)) / "nyu"
    if folder.is_dir():
        return f"NYU frame {number}", replace(NYUFolder(folder).read(number).cloud, T_world_sensor=np.eye(4))
    return "synthetic room", synthetic_room(views=1, camera=DepthCamera(640, 480)).scan().truth


def compare(cloud: LabelledCloud, resolution: float, discretize: bool, repeats: int) -> dict[str, Any]:
    """Return the best time and the memory of both."""
    origin = np.array(cloud.origin)
    ours, map_seconds = best(repeats, partial(insert, cloud, resolution, discretize))
    facts = {
        "semgp_s": map_seconds,
        "semgp_bytes": ours.info()["memory_bytes"],
        "semgp_occupancy_bytes": ours.info()["occupancy_bytes"],
        "voxels": len(ours),
        "labelled_voxels": ours.info()["labelled_voxels"],
    }
    try:
        import octomap
    except ImportError:
        return facts

    def theirs(points: np.ndarray) -> Any:
        tree = octomap.OcTree(resolution)
        tree.insertPointCloud(points, origin, discretize=discretize)
        return tree

    tree, seconds = best(repeats, partial(theirs, cloud.points))
    _, copying = best(repeats, partial(theirs, np.tile(origin, (len(cloud), 1))))
    return {
        **facts,
        "octomap_s": seconds,
        "octomap_copying_s": copying,
        "octomap_bytes": tree.memoryUsage(),
        "speedup": seconds / map_seconds,
        "speedup_without_copying": (seconds - copying) / map_seconds,
    }


def exponents(cloud: LabelledCloud, resolution: float, discretize: bool) -> dict[str, Any]:
    """Return the times for parts of the cloud, and the exponent of their growth."""
    parts = [cloud[::stride] for stride in STRIDES]
    sizes = [len(part) for part in parts]
    seconds = [best(3, partial(insert, part, resolution, discretize))[1] for part in parts]
    slope = np.polyfit(np.log(sizes), np.log(seconds), 1)[0]
    return {"points": sizes, "seconds": seconds, "exponent": float(slope)}


def insert(cloud: LabelledCloud, resolution: float, discretize: bool) -> SemanticOctoMap:
    octomap = SemanticOctoMap(cloud.classes, resolution, discretize=discretize)
    octomap.update(cloud)
    return octomap


def best(repeats: int, work: Callable[[], Any]) -> tuple[Any, float]:
    """Return the last result and the shortest time of several runs, after one that compiles."""
    result, seconds = work(), []
    for _ in range(repeats):
        began = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - began)
    return result, min(seconds)


def show(title: str, rows: list[dict[str, Any]], growth: list[dict[str, Any]]) -> None:
    table = Table(title=title)
    for column in ("mode", "semgp s", "OctoMap s", "copying s", "speed-up", "semgp MB", "OctoMap MB"):
        table.add_column(column, justify="left" if column == "mode" else "right", no_wrap=column == "mode")
    for row in rows:
        theirs = ["not installed"] * 4
        if "octomap_s" in row:
            theirs = [f"{row['octomap_s']:.3f}", f"{row['octomap_copying_s']:.3f}", f"{row['speedup']:.1f}"]
            theirs.append(f"{row['octomap_bytes'] / 1e6:.2f}")
        megabytes = f"{row['semgp_bytes'] / 1e6:.2f}"
        table.add_row(row["mode"], f"{row['semgp_s']:.3f}", *theirs[:3], megabytes, theirs[3])
    Console().print(table)
    table = Table(title="semgp, seconds by number of points")
    table.add_column("mode", no_wrap=True)
    for n in growth[0]["points"]:
        table.add_column(f"{n:,}", justify="right")
    table.add_column("exponent", justify="right")
    for row in growth:
        table.add_row(row["mode"], *(f"{s:.4f}" for s in row["seconds"]), f"{row['exponent']:.2f}")
    Console().print(table)


if __name__ == "__main__":
    main()
