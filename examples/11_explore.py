"""A robot explores a building that it has never seen, and maps it: three ways to choose where to go next.

    uv run examples/11_explore.py --out explore.png

A round robot with a small lidar comes in at the western end of the corridor. It knows its map and nothing else: it
drives where the map says that nothing is, scans, and chooses again: the place whose scan is expected to tell most
for each metre of way, the nearest place at a frontier of the unknown, or any place. All three have the same start,
sensor and number of scans, in the same buildings.

Above: how much of the surfaces that can be seen is known, over metres driven and over scans, and how uncertain the
map is on average about what is free, over metres (random goals drive on beyond the axis). Thick lines are means
over the buildings, thin ones single buildings. Below: what each robot has mapped of the first building, seen from
above, in the colours of the classes; grey is unknown, thin lines are the true rooms. The way leads from the star
to the circle, with a dot for each scan. Information tells most for each scan; small steps to frontiers save way.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import PercentFormatter
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from semgp.classes import MISSING
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.maps.protocol import SpatialMap
from semgp.planning import frontiers, information_gain, occupancy_grid
from semgp.prediction import FREE
from semgp.scene.building import SyntheticBuilding

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

RADIUS, CLEARANCE = 0.2, 0.3  # metres: the robot's own, and the one it plans with
CELL = 0.2  # metres, of the grid it plans on
BODY = 0.15, 1.15  # metres: heights at which it could touch something
LEVEL = 0.8, 1.2  # metres: frontiers are looked for about the height of the lidar
FRONTIER, AT_FRONTIER = 8, 0.5  # cells of a frontier that is worth a visit, and how near one gets, in metres
SQUARE, RAYS = 1.5, {"beams": 8, "columns": 24}  # one view a square of so many metres is rated, by so many rays
NEW_PLACE = 1.0  # metres from all earlier scans


def new_map(building: SyntheticBuilding) -> SpatialMap:
    """Return an empty map; any that keeps free space does, such as SemanticOctoMap(building.classes, 0.1)."""
    return GPSemanticMap(building.classes, replace(GENERAL, resolution=0.1), tolerance=0.2, free=FreeSpace())


class Truth:
    """What is true of a building, to judge maps by; robots never see it."""

    def __init__(self, building: SyntheticBuilding) -> None:
        rng = np.random.default_rng(0)
        surfaces = building.surfaces(RADIUS, resolution=0.2)
        surfaces = surfaces[rng.permutation(len(surfaces))[:6000]]
        floor = rng.permutation(building.reachable(RADIUS))[:2000]
        space = rng.uniform(0, building.size, (4000, 3))
        self.labels = surfaces.hard_labels
        self.points = np.vstack([surfaces.points, np.insert(floor, 2, 0.5, axis=1), space])
        self.borders = [len(surfaces), len(surfaces) + len(floor)]

    def judge(self, semantic_map: SpatialMap) -> tuple[float, float, float, float]:
        """Return the shares of surfaces and floor known, of known labels right, and the mean entropy in nats."""
        prediction = semantic_map.query(self.points)
        occupancy = prediction.occupancy
        assert occupancy is not None
        label, *_ = np.split(prediction.label, self.borders)
        _, floor, _ = np.split(occupancy.state, self.borders)
        *_, entropy = np.split(np.where(occupancy.known, occupancy.entropy, np.log(2)), self.borders)
        seen = label != MISSING
        right = label[seen] == self.labels[seen]
        return float(seen.mean()), float((floor == FREE).mean()), float(right.mean()), float(entropy.mean())


@dataclass(frozen=True, eq=False)
class Roads:
    """Where the robot can go on its map: cells (n, 2), the way to each in metres, and the cell before it."""

    cells: Array
    metres: Array
    before: NDArray[np.int32]

    def way_to(self, i: int) -> Array:
        """Return the places (m, 2) on the way to cell i, from the robot on."""
        way = [i]
        while self.before[way[-1]] >= 0:
            way.append(int(self.before[way[-1]]))
        return self.cells[way[::-1]]


@dataclass(eq=False)
class Robot:
    """A robot in a building, its map, and for each scan a record: metres driven, and what `Truth.judge` says."""

    building: SyntheticBuilding
    truth: Truth
    map: SpatialMap
    rng: np.random.Generator
    metres: float = 0.0
    way: list[Array] = field(default_factory=list)
    scanned_at: list[Array] = field(default_factory=list)
    touched: list[Array] = field(default_factory=list)
    records: list[tuple[float, ...]] = field(default_factory=list)

    def scan(self) -> None:
        """Scan from where it stands, and keep a record."""
        place = self.way[-1]
        self.map.update(self.building.scan(self.building.pose(place), len(self.records)))
        self.scanned_at.append(place)
        self.records.append((self.metres, *self.truth.judge(self.map)))

    def drive(self, way: Array) -> None:
        """Drive along a way to its end, or to where something stands that the map did not know of."""
        for place in way[1:]:
            if not self.building.is_free(np.linspace(self.way[-1], place, 5), RADIUS).all():
                self.touched.append(place)
                return
            self.metres += float(np.linalg.norm(place - self.way[-1]))
            self.way.append(place)

    def roads(self) -> Roads:
        """Return the shortest ways over cells that the map knows to be free, to their eight neighbours."""
        grid = occupancy_grid(self.map, (0, 0), self.building.size[:2], heights=BODY, resolution=CELL)
        for x, y in self.touched:
            grid.data[int(y / CELL), int(x / CELL)] = 100
        row, column = np.indices(grid.data.shape)
        centres = grid.origin + CELL * (np.stack([column, row], axis=-1) + 0.5)
        from_robot = np.linalg.norm(centres - self.way[-1], axis=-1)
        from_obstacle = CELL * ndimage.distance_transform_edt(grid.data < 50)
        free = ((grid.data >= 0) & (from_obstacle > CLEARANCE)) | (from_robot < CLEARANCE)
        cells = centres[free]
        a, b = cKDTree(cells).query_pairs(1.5 * CELL, output_type="ndarray").T
        length = np.linalg.norm(cells[a] - cells[b], axis=1)
        graph = coo_array((length, (a, b)), (len(cells), len(cells))).tocsr()
        start = np.linalg.norm(cells - self.way[-1], axis=1).argmin()
        metres, before = dijkstra(graph, False, start, return_predecessors=True)
        return Roads(cells, metres, before)


def by_information(robot: Robot, roads: Roads, candidates: Indices) -> int:
    """Return where a scan is expected to tell most, beyond what another one from here would, for a metre of way.

    The scan itself counts as a metre, so that near places do not always win.
    """
    candidates = robot.rng.permutation(candidates)
    _, one_a_square = np.unique(roads.cells[candidates] // SQUARE, axis=0, return_index=True)
    drawn = candidates[one_a_square]
    poses = [robot.building.pose(place) for place in (*roads.cells[drawn], robot.way[-1])]
    lidar = robot.building.lidar
    rays = replace(lidar, **RAYS).rays.reshape(-1, 3)
    gain = information_gain(robot.map, np.stack(poses), rays, max_range=lidar.reach, spacing=CELL).total
    return int(drawn[np.argmax((gain[:-1] - gain[-1]) / (1 + roads.metres[drawn]))])


def by_frontier(robot: Robot, roads: Roads, candidates: Indices) -> int:
    """Return the place with the shortest way of those from which a frontier is near."""
    low, high = (0, 0, LEVEL[0]), (*robot.building.size[:2], LEVEL[1])
    found = frontiers(robot.map, low, high, resolution=CELL)
    points = found.points[found.sizes[found.cluster] >= FRONTIER, :2]
    near = np.empty(0, dtype=np.intp)
    if len(points):
        near = candidates[cKDTree(points).query(roads.cells[candidates])[0] < AT_FRONTIER]
    return int(near[np.argmin(roads.metres[near])]) if len(near) else by_chance(robot, roads, candidates)


def by_chance(robot: Robot, roads: Roads, candidates: Indices) -> int:
    """Return any place."""
    return int(robot.rng.choice(candidates))


STRATEGIES: dict[str, tuple[Callable[[Robot, Roads, Indices], int], str]] = {
    "information per metre": (by_information, "#c4161c"),
    "nearest frontier": (by_frontier, "#2a5db0"),
    "random goals": (by_chance, "#7a7a74"),
}


def explore(building: SyntheticBuilding, truth: Truth, strategy: str, scans: int) -> Robot:
    """Return the robot after so many scans, or when there is no new place to scan from."""
    rng = np.random.default_rng(building.seed)
    robot = Robot(building, truth, new_map(building), rng, way=[building.entrance])
    robot.scan()
    while len(robot.records) < scans:
        roads = robot.roads()
        new = cKDTree(np.array(robot.scanned_at)).query(roads.cells)[0] > NEW_PLACE
        candidates = np.flatnonzero(np.isfinite(roads.metres) & new)
        if not len(candidates):
            break
        robot.drive(roads.way_to(STRATEGIES[strategy][0](robot, roads, candidates)))
        robot.scan()
    return robot


def curves(axes: Axes, runs: dict[str, list[Robot]], x: int | None, y: int, title: str) -> None:
    """Draw a column of the records over another one, or over the number of scans."""
    furthest = 0.0
    for strategy, (_, colour) in STRATEGIES.items():
        records = [np.array(robot.records) for robot in runs[strategy]]
        over = [np.arange(1.0, len(r) + 1) if x is None else r[:, x] for r in records]
        for xs, r in zip(over, records):
            axes.plot(xs, r[:, y], color=colour, linewidth=0.8, alpha=0.5 if len(records) > 1 else 0)
        common = np.linspace(min(xs[0] for xs in over), min(xs[-1] for xs in over), 200)
        mean = np.mean([np.interp(common, xs, r[:, y]) for xs, r in zip(over, records)], axis=0)
        axes.plot(common, mean, color=colour, linewidth=2.6, label=strategy)
        furthest = max(furthest, common[-1] if strategy != "random goals" else 0)
    axes.set(title=title, xlabel="scans" if x is None else "metres driven", xlim=(0, furthest))
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


def floor_plan(axes: Axes, robot: Robot, strategy: str) -> None:
    """Draw what the robot has mapped, seen from above, and its way."""
    size = robot.building.size
    grid = occupancy_grid(robot.map, (0, 0), size[:2], heights=(0.3, 1.9), resolution=0.1)
    image = np.full((*grid.data.shape, 3), 250, dtype=np.uint8)
    labelled = grid.label != MISSING
    image[(grid.data < 0) | ((grid.data >= 50) & ~labelled)] = 205
    image[labelled] = robot.map.classes.palette[grid.label[labelled]]
    axes.imshow(image, origin="lower", extent=(0, size[0], 0, size[1]), interpolation="nearest")
    for room in robot.building.plan.rooms:
        (x, right), (y, top) = room.x, room.y
        axes.add_patch(Rectangle((x, y), right - x, top - y, fill=False, color="black", linewidth=0.5, alpha=0.5))
    colour = STRATEGIES[strategy][1]
    way, scans = np.array(robot.way).T, np.array(robot.scanned_at).T
    axes.plot(*way, color="white", linewidth=3.2)
    axes.plot(*way, color=colour, linewidth=1.6)
    axes.plot(*scans, "o", color=colour, markersize=4.5, markeredgecolor="white", markeredgewidth=0.8)
    axes.plot(*way[:, 0], "*", color=colour, markersize=17, markeredgecolor="white")
    axes.plot(*way[:, -1], "o", color="white", markersize=10, markeredgecolor=colour, markeredgewidth=2.5)
    metres, surfaces, *_ = robot.records[-1]
    axes.set_title(f"{strategy}: {surfaces:.0%} known after {metres:.0f} m", color=colour)
    axes.set(xticks=(), yticks=())


def draw(runs: dict[str, list[Robot]], out: Path) -> None:
    figure = Figure(figsize=(15, 9.2), layout="constrained")
    FigureCanvasAgg(figure)
    top = [figure.add_subplot(2, 3, i + 1) for i in range(3)]
    curves(top[0], runs, 0, 1, "surfaces known, by way driven")
    curves(top[1], runs, None, 1, "surfaces known, by scans")
    curves(top[2], runs, 0, 4, "mean entropy of free or occupied, nats")
    top[1].legend(loc="lower right", framealpha=0.9)
    for axes in top[:2]:
        axes.set_ylim(0, 1)
        axes.yaxis.set_major_formatter(PercentFormatter(1))
    for i, (strategy, robots) in enumerate(runs.items()):
        floor_plan(figure.add_subplot(2, 3, 4 + i), robots[0], strategy)
    classes = runs["random goals"][0].map.classes
    colours = {name: f"#{r:02x}{g:02x}{b:02x}" for name, (r, g, b) in zip(classes.names, classes.colours)}
    handles = [Patch(color=c, label=name) for name, c in colours.items() if name not in ("floor", "ceiling")]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    figure.savefig(out, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("explore.png"))
    parser.add_argument("--steps", type=int, default=28, help="scans of each robot")
    parser.add_argument("--seeds", type=int, default=1, help="number of buildings")
    args = parser.parse_args()

    runs: dict[str, list[Robot]] = {strategy: [] for strategy in STRATEGIES}
    print("building  strategy               scans  metres  surfaces  floor  right  entropy  touched")
    for seed in range(args.seeds):
        building = SyntheticBuilding(seed)
        truth = Truth(building)
        for strategy, robots in runs.items():
            robot = explore(building, truth, strategy, args.steps)
            robots.append(robot)
            for i in (len(robot.records) // 2, len(robot.records)):
                metres, surfaces, floor, right, entropy = robot.records[i - 1]
                print(
                    f"{seed:8}  {strategy:22} {i:5}  {metres:6.1f}  {surfaces:8.1%}  {floor:5.1%}  {right:5.1%}  "
                    f"{entropy:7.3f}  {len(robot.touched):7}"
                )
    draw(runs, args.out)
    print(args.out)


if __name__ == "__main__":
    main()
