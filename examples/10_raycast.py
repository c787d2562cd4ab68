"""What a robot sees in its map: rays cast into it from where no scan was taken, and the grid that it plans on.

    uv run examples/10_raycast.py --out raycast.png

A lidar scans a building from twelve places; a tenth of its labels are wrong, in patches. Then 432 x 288 rays of a
camera go out into the map, and each answers where it first meets something, what that is, and how sure the map is.

From the left: the class that is met and how far away it is, in truth above and in the map below; the probability
of the class that the map shows, low at borders and where scans contradict each other; and a slice of the map as a
cost grid, from below the floor up to the robot's height, with the places of the scans and the camera's view.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from semgp import PRESETS, GPSemanticMap
from semgp.maps.free_space import FreeSpace
from semgp.picture import GREY, View, by_class, splat
from semgp.planning import OccupancyGrid, occupancy_grid, raycast
from semgp.scene import DepthCamera
from semgp.scene.building import SyntheticBuilding
from semgp.scene.lidar import Lidar
from semgp.scene.raycast import Solids, cast

Array = NDArray[np.float64]

BUILDING = SyntheticBuilding(seed=0, lidar=Lidar(beams=64, columns=720, top=45, bottom=-45, reach=8, noise=0.01))
CLASSES = BUILDING.classes
CAMERA = DepthCamera(width=432, height=288, focal=0.62)  # 78 degrees wide
EYE, TARGET = (5.7, 4.6, 1.5), (2.25, 2.0, 0.75)
VIEW = View.look_at(EYE, TARGET, fov=2 * np.degrees(np.arctan(1 / 3 / 0.62)), width=960, height=640)
HIGH = (9.2, 8.4)  # metres: the corner of the part of the building that is mapped
COSTS = {"floor": 0, "chair": 50}  # all other classes are lethal


def true_view(origin: Array, rays: Array) -> tuple[Array, NDArray[np.int32]]:
    """Return distance and label of what each ray meets in the building itself."""
    parts = [(s.shape, s.centre, s.half, s.yaw) for thing in BUILDING.plan.things for s in thing.solids]
    labels = [CLASSES.index(thing.name) for thing in BUILDING.plan.things for _ in thing.solids]
    shape, centre, half, yaw = (np.array(part) for part in zip(*parts))
    hits = cast(Solids(shape, centre, half, yaw), origin, rays)
    return hits.distance, np.array(labels, dtype=np.int32)[hits.solid]


def show_classes(axes: Axes, points: Array, distance: Array, labels: NDArray[np.int32], title: str) -> None:
    met = np.isfinite(distance)
    size = 1.3 * distance[met] / VIEW.focal * VIEW.width / CAMERA.width
    axes.imshow(splat(points[met], by_class(labels[met], CLASSES), VIEW, size))
    axes.set_title(title)


def show_grid(axes: Axes, grid: OccupancyGrid, places: Array) -> None:
    assert grid.costs is not None
    levels = np.searchsorted((-1, 0, 50, 100), grid.costs)
    colours = ListedColormap(["#c8c8c4", "white", "#f5a35c", "#2e3436"])
    axes.imshow(levels, cmap=colours, vmin=0, vmax=3, origin="lower", extent=(0, HIGH[0], 0, HIGH[1]))
    axes.plot(*places.T, "o", color="#3465a4", markersize=5)
    ends = [VIEW.T_world_camera[:3, :3] @ (side / CAMERA.focal / 2, 0, 1) for side in (-1, 1)]
    for x, y, _ in ends:
        axes.plot((EYE[0], EYE[0] + 1.5 * x), (EYE[1], EYE[1] + 1.5 * y), color="#c4161c")
    names = ("unknown", "free", "50: chair", "100: lethal")
    keys = [Patch(facecolor=colours(i), edgecolor="grey", label=name) for i, name in enumerate(names)]
    axes.legend(handles=keys, loc="upper center", bbox_to_anchor=(0.5, 0), ncols=4, frameon=False)
    axes.set_title("cost grid, with scans and camera")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("raycast.png"))
    out = parser.parse_args().out

    places = BUILDING.reachable(0.3, spacing=0.25)
    places = places[(places < np.array(HIGH) - 0.3).all(axis=1)]
    places = places[np.random.default_rng(1).permutation(len(places))[:12]]
    building_map = GPSemanticMap(CLASSES, replace(PRESETS["general"], resolution=0.04), free=FreeSpace())
    for i, place in enumerate(places):
        building_map.update(BUILDING.scan(BUILDING.pose(place), i))

    origin, turn = VIEW.T_world_camera[:3, 3], VIEW.T_world_camera[:3, :3]
    rays = CAMERA.rays.reshape(-1, 3) @ turn.T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    distance, labels = true_view(origin, rays)
    hits = raycast(building_map, origin, rays, max_range=12)
    error = np.abs(hits.distance - distance)[hits.met]
    right = (hits.label == labels).mean()
    print(f"{len(hits):,} rays: {hits.met.mean():.1%} meet something, {right:.1%} meet the right class;")
    print(f"median error of the depth {100 * np.median(error):.1f} cm")
    grid = occupancy_grid(building_map, (0, 0), HIGH, heights=(-0.1, 1.1), resolution=0.05, costs=COSTS)

    figure = Figure(figsize=(17, 8.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 3)
    show_classes(axes[0, 0], origin + distance[:, None] * rays, distance, labels, "what is there")
    show_classes(axes[1, 0], hits.points, hits.distance, hits.label, "the map's class")
    shape = CAMERA.height, CAMERA.width
    probability = hits.class_probability.max(axis=1)
    for place, values, title, most, colours in (
        (axes[0, 1], distance, "true distance (m)", distance.max(), "viridis"),
        (axes[1, 1], hits.distance, "the map's distance (m)", distance.max(), "viridis"),
        (axes[0, 2], probability, "probability of the class shown", 1, "magma"),
    ):
        picture = place.imshow(values.reshape(shape), vmin=0, vmax=most, cmap=colours)
        place.set_title(title)
        figure.colorbar(picture, ax=place, shrink=0.85)
    show_grid(axes[1, 2], grid, places)
    for place in axes.flat:
        place.set(xticks=[], yticks=[])
    palette = np.vstack([CLASSES.palette, GREY]) / 255
    swatches = [Patch(color=colour, label=name) for name, colour in zip((*CLASSES.names, "no label"), palette)]
    figure.legend(handles=swatches, loc="outside lower center", ncols=len(swatches), frameon=False)
    figure.savefig(out, dpi=110)
    print(out)


if __name__ == "__main__":
    main()
