"""A robot explores a building that it has never seen, and maps it: three ways to choose where to go next.

    uv run examples/explore.py --out explore.png

A round robot with a small lidar comes in at the western end of the corridor. It knows only its map: it drives where
that is free, to goals that it picks by the information that a scan is expected to give for each metre of way, by the
nearest frontier of the unknown, or by chance, and scans at each goal and every two metres on the way. All three have
the same start, sensor and number of scans.

Above: how much of the floor and of the surfaces that can be seen is known, over metres driven and over scans, as
means over the buildings, each a thin line. Below: what each robot has mapped of the first building, walls and
furniture in the colours of their classes, with its way, from the star to the circle.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from semgp.classes import MISSING
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.maps.protocol import SpatialMap
from semgp.planning import frontiers, information_gain, occupancy_grid
from semgp.prediction import FREE
from semgp.scene.building import SyntheticBuilding

Array = NDArray[np.float64]

RADIUS, CLEARANCE = 0.2, 0.3  # metres: the robot's, and the one it plans with
CELL, HEIGHTS = 0.2, (0.15, 1.15)  # of the grid that it plans on: what stands as high as the robot
SCAN_EVERY = 99.0  # metres of way between two scans, if the goal is farther
VIEWS = 24  # places whose information gain is compared
STRATEGIES = {"information per metre": "#c4161c", "nearest frontier": "#3465a4", "random goal": "#8a8a84"}


def new_map(building: SyntheticBuilding) -> SpatialMap:
    """Return an empty map; any other that keeps free space does, such as SemanticOctoMap(building.classes, 0.1)."""
    free = FreeSpace(rays=2048)
    return GPSemanticMap(building.classes, replace(GENERAL, resolution=0.1), tolerance=0.2, free=free)


@dataclass(frozen=True, eq=False)
class Roads:
    """Where the robot can go on its map: cells (n, 2), the way to each in metres, and the cell before it."""

    cells: Array
    metres: Array
    before: NDArray[np.int32]

    def way_to(self, i: int) -> Array:
        """Return the places (m, 2) on the way to a cell, from the robot on."""
        way = [i]
        while self.before[way[-1]] >= 0:
            way.append(int(self.before[way[-1]]))
        return self.cells[way[::-1]]


class Truth:
    """What is true of a building, to judge a map by; the robot never sees it."""

    def __init__(self, building: SyntheticBuilding) -> None:
        rng = np.random.default_rng(0)
        surfaces = building.surfaces(RADIUS, resolution=0.2)
        surfaces = surfaces[rng.permutation(len(surfaces))[:6000]]
        floor = rng.permutation(building.reachable(RADIUS))[:2000]
        self.labels = surfaces.hard_labels
        space = rng.uniform(0, building.size, (4000, 3))
        self.points = np.vstack([surfaces.points, np.column_stack([floor, np.full(len(floor), 0.5)]), space])
        self.parts = np.split(np.arange(len(self.points)), [len(surfaces), len(surfaces) + len(floor)])

    def judge(self, semantic_map: SpatialMap) -> tuple[float, float, float, float]:
        """Return the shares of floor and surfaces that are known, of known labels that are right, and the entropy."""
        prediction = semantic_map.query(self.points)
        assert prediction.occupancy is not None
        surfaces, floor, space = self.parts
        label = prediction.label[surfaces]
        seen = label != MISSING
        entropy = np.where(prediction.occupancy.known, prediction.occupancy.entropy, np.log(2))[space]
        floor_known = prediction.occupancy.state[floor] == FREE
        return floor_known.mean(), seen.mean(), (label == self.labels)[seen].mean(), entropy.mean()


@dataclass(eq=False)
class Robot:
    """A robot in a building, its map, and its records: a row for each scan."""

    building: SyntheticBuilding
    truth: Truth
    rng: np.random.Generator
    map: SpatialMap = field(init=False)
    position: Array = field(init=False)
    way: list[Array] = field(default_factory=list)
    scanned_at: list[Array] = field(default_factory=list)
    records: list[tuple[float, ...]] = field(default_factory=list)
    metres: float = 0.0
    bumps: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.map, self.position = new_map(self.building), self.building.entrance
        self.way.append(self.position)

    def scan(self) -> None:
        cloud = self.building.scan(self.building.pose(self.position), len(self.records))
        self.map.update(cloud)
        self.scanned_at.append(self.position)
        self.records.append((self.metres, *self.truth.judge(self.map)))

    def roads(self) -> Roads:
        """Return the ways that the map knows to be free, from cell to cell of a grid and its eight neighbours."""
        grid = occupancy_grid(self.map, (0, 0), self.building.size[:2], heights=HEIGHTS, resolution=CELL)
        for x, y in self.bumps:
            grid.data[int(y / CELL), int(x / CELL)] = 100
        room = ndimage.distance_transform_edt(grid.data < 50) * CELL  # to the next obstacle
        rows, columns = np.indices(grid.data.shape)
        centres = grid.origin + CELL * (np.stack([columns, rows], axis=-1) + 0.5)
        here = np.hypot(*(centres - self.position).transpose(2, 0, 1))
        free = ((grid.data >= 0) & (room > CLEARANCE)) | (here < CLEARANCE)
        number = np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1)
        edges = [_neighbours(number, step) for step in ((0, 1), (1, 0), (1, 1), (1, -1))]
        a, b, length = (np.concatenate(part) for part in zip(*edges))
        n = np.count_nonzero(free)
        graph = coo_array((length, (a, b)), (n, n)).tocsr()
        metres, before = dijkstra(graph, False, number.flat[here.argmin()], return_predecessors=True)
        return Roads(centres[free], metres, before)

    def drive(self, way: Array, scans: int) -> None:
        """Drive along a way until it ends, or something is in the way, with at most so many scans."""
        since = 0.0
        for place in way[1:]:
            if not self.building.is_free(np.linspace(self.position, place, 5), RADIUS).all():
                self.bumps.append(place)
                break
            step = float(np.hypot(*(place - self.position)))
            self.metres, since, self.position = self.metres + step, since + step, place
            self.way.append(place)
            if since >= SCAN_EVERY:
                self.scan()
                since, scans = 0.0, scans - 1
            if not scans:
                return
        self.scan()


def _neighbours(number: NDArray[np.int64], step: tuple[int, int]) -> tuple[Array, Array, Array]:
    """Return the numbers of cells and of their neighbours one step away, where both have one, and the lengths."""
    rows, columns = number.shape
    dy, dx = step
    a = number[: rows - dy, max(0, -dx) : columns - max(0, dx)].ravel()
    b = number[dy:, max(0, dx) : columns + min(0, dx)].ravel()
    both = (a >= 0) & (b >= 0)
    return a[both], b[both], np.full(np.count_nonzero(both), CELL * np.hypot(dx, dy))


def by_information(robot: Robot, roads: Roads, candidates: NDArray[np.intp]) -> int:
    """Return the place whose scan is expected to tell most for each metre of way, the scan itself as one metre."""
    drawn = robot.rng.permutation(candidates)[:VIEWS]
    poses = np.stack([robot.building.pose(place) for place in roads.cells[drawn]])
    lidar = robot.building.lidar
    rays = replace(lidar, beams=8, columns=36).rays.reshape(-1, 3)
    gain = information_gain(robot.map, poses, rays, max_range=lidar.reach, spacing=CELL)
    return int(drawn[np.argmax(gain.total / (1 + roads.metres[drawn]))])


def by_frontier(robot: Robot, roads: Roads, candidates: NDArray[np.intp]) -> int:
    """Return the place, within a metre of a frontier, that is the shortest way off."""
    low, high = (0, 0, HEIGHTS[0]), (*robot.building.size[:2], HEIGHTS[1])
    found = frontiers(robot.map, low, high, resolution=CELL)
    large = found.points[found.sizes[found.cluster] >= 8, :2]
    if not len(large):
        return by_chance(robot, roads, candidates)
    from_frontier = np.hypot(*(roads.cells[candidates, None] - large).transpose(2, 0, 1)).min(axis=1)
    order = roads.metres[candidates] + 100 * np.maximum(from_frontier - 1, 0)
    return int(candidates[np.argmin(order)])


def by_chance(robot: Robot, roads: Roads, candidates: NDArray[np.intp]) -> int:
    """Return any place."""
    return int(robot.rng.choice(candidates))


CHOOSE: dict[str, Callable[[Robot, Roads, NDArray[np.intp]], int]] = dict(
    zip(STRATEGIES, (by_information, by_frontier, by_chance))
)


def explore(building: SyntheticBuilding, truth: Truth, strategy: str, scans: int) -> Robot:
    """Return the robot after so many scans."""
    robot = Robot(building, truth, np.random.default_rng(building.seed))
    robot.scan()
    while len(robot.records) < scans:
        roads = robot.roads()
        from_scans = np.hypot(*(roads.cells[:, None] - np.array(robot.scanned_at)).transpose(2, 0, 1)).min(axis=1)
        candidates = np.flatnonzero(np.isfinite(roads.metres) & (from_scans > 0.5))
        goal = CHOOSE[strategy](robot, roads, candidates)
        robot.drive(roads.way_to(goal), scans - len(robot.records))
    return robot


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("explore.png"))
    parser.add_argument("--steps", type=int, default=36, help="scans of each robot")
    parser.add_argument("--seeds", type=int, default=1, help="buildings")
    args = parser.parse_args()
    runs: dict[str, list[Robot]] = {strategy: [] for strategy in STRATEGIES}
    for seed in range(args.seeds):
        building = SyntheticBuilding(seed)
        truth = Truth(building)
        for strategy in STRATEGIES:
            start = time.time()
            robot = explore(building, truth, strategy, args.steps)
            runs[strategy].append(robot)
            metres, floor, surfaces, right, entropy = robot.records[-1]
            print(
                f"building {seed}, {strategy:22} {metres:5.1f} m: floor {floor:.0%}, surfaces {surfaces:.0%}, "
                f"labels right {right:.1%}, entropy {entropy:.3f} nats, bumps {len(robot.bumps)} ({time.time() - start:.0f} s)",
                flush=True,
            )
    import pickle; pickle.dump({k:[(np.array(r.records),np.array(r.way),np.array(r.scanned_at)) for r in v] for k,v in runs.items()},open("/tmp/explore_task/runs.pkl","wb"))


if __name__ == "__main__":
    main()
