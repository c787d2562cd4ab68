"""What planners' questions cost: ray casting, information gain, frontiers and grid slices.

    uv run python benchmarks/planning.py [--json] [--map octomap|gp] [--scene town|room] [--scans 10] [--repeats 3]

Ten scans of the synthetic town, in voxels of 20 cm, or ten views of the synthetic room, in voxels of 5 cm, go into
an OctoMap or a Gaussian-process map with free space. Printed are seconds, the best of the repeats, and at how many
points, and how often, the map was asked.

* rays: 10,000 rays of 20 m, or 5 m in the room, from one place, in directions in which points were measured.
* rays, unknown: the same with the length of unknown space that each passes.
* gains: 50 views of 500 rays.
* frontiers, grid: a box round the sensor in cells of the map's resolution.

`table` measures any map: give it one, and where the sensor was.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.console import Console
from rich.table import Table

from semgp.cloud import LabelledCloud
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL, OUTDOOR_LIDAR
from semgp.maps.protocol import SpatialMap
from semgp.octomap import SemanticOctoMap
from semgp.parallel import n_workers
from semgp.planning import frontiers, information_gain, occupancy_grid, raycast
from semgp.prediction import Prediction
from semgp.scene import synthetic_room
from semgp.scene.town import SyntheticTown

RAYS, VIEWS, RAYS_A_VIEW = 10_000, 50, 500
Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--map", choices=("octomap", "gp"), default="octomap")
    parser.add_argument("--scene", choices=("town", "room"), default="town")
    parser.add_argument("--scans", type=int, default=10)
    parser.add_argument("--repeats", type=int, default=3, help="the best of so many runs counts")
    options = parser.parse_args()
    if options.scene == "town":
        scans = [SyntheticTown().scan(i).observed for i in range(options.scans)]
        model, max_range, box = OUTDOOR_LIDAR, 20.0, np.array([20.0, 20.0, 3.0])
    else:
        room = synthetic_room(views=options.scans)
        scans = [room.scan(i).observed for i in range(options.scans)]
        model, max_range, box = GENERAL, 5.0, np.array([1.5, 1.5, 1.0])
    made = (
        GPSemanticMap(scans[0].classes, model, free=FreeSpace())
        if options.map == "gp"
        else SemanticOctoMap(scans[0].classes, model.resolution)
    )
    for scan in scans:
        made.update(scan)
    rows = table(made, scans[-1], max_range, box, options.repeats)
    facts = {
        "map": options.map, "scene": options.scene, "scans": len(scans), "voxel m": model.resolution,
        "occupied": len(made.occupied_positions), "free": len(made.free_positions), "threads": n_workers(),
    }  # fmt: skip
    if options.json:
        print(json.dumps({**facts, "rows": rows}, indent=2))
    else:
        show(", ".join(f"{name} {fact}" for name, fact in facts.items()), rows)


def table(
    semantic_map: SpatialMap, scan: LabelledCloud, max_range: float, box: NDArray[np.float64], repeats: int = 3
) -> list[Row]:
    """Measure a map that took in a scan; boxes reach half sizes (3,), in metres, from the sensor."""
    assert scan.T_world_sensor is not None, "planners begin where the sensor was"
    T, origin = scan.T_world_sensor, scan.T_world_sensor[:3, 3]
    rng = np.random.default_rng(0)
    away = (scan.points - origin)[rng.integers(len(scan), size=RAYS)]
    poses = np.tile(T, (VIEWS, 1, 1))
    poses[:, :2, 3] += rng.normal(scale=max_range / 8, size=(VIEWS, 2))
    fan = away[:RAYS_A_VIEW] @ T[:3, :3]
    low, high = origin - box, origin + box
    counted = Counted(semantic_map)
    asked, heights, edge = cast(SpatialMap, counted), (low[2], high[2]), semantic_map.resolution
    questions: dict[str, Callable[[], Any]] = {
        "rays": lambda: raycast(asked, origin, away, max_range=max_range),
        "rays, unknown": lambda: raycast(asked, origin, away, max_range=max_range, through_unknown=True),
        "gains": lambda: information_gain(asked, poses, fan, max_range=max_range),
        "frontiers": lambda: frontiers(asked, low, high),
        "grid": lambda: occupancy_grid(asked, low[:2], high[:2], heights=heights, resolution=edge),
    }
    rows: list[Row] = []
    for name, ask in questions.items():
        ask()  # compiles, and solves what is not yet solved
        counted.points = counted.times = 0
        seconds = [duration(ask) for _ in range(repeats)]
        points, times = counted.points // repeats, counted.times // repeats
        rows.append({"question": name, "s": min(seconds), "points asked": points, "asked": times})
    return rows


def duration(ask: Callable[[], Any]) -> float:
    began = time.perf_counter()
    ask()
    return time.perf_counter() - began


class Counted:
    """A map that counts at how many points, and how often, it is asked."""

    def __init__(self, semantic_map: SpatialMap) -> None:
        self._map, self.points, self.times = semantic_map, 0, 0

    def query(self, points: ArrayLike) -> Prediction:
        """Ask the map."""
        X = np.asarray(points)
        self.points, self.times = self.points + len(X), self.times + 1
        return self._map.query(X)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._map, name)


def show(title: str, rows: list[Row]) -> None:
    shown = Table(title=title)
    for name in rows[0]:
        shown.add_column(name, justify="left" if name == "question" else "right")
    for row in rows:
        shown.add_row(row["question"], f"{row['s']:.3f}", f"{row['points asked']:,}", str(row["asked"]))
    Console(width=140).print(shown)


if __name__ == "__main__":
    main()
