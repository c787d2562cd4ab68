"""Occupied, free or unknown, and of which class: one map that answers at any point of space.

    uv run examples/06_free_space.py --out free_space.png

A lidar on a robot has scanned a synthetic building from a few places. A slice of the map, 20 cm above the seats,
is asked every three centimetres. Above: what is truly there, and what a Semantic OctoMap of the same scans says,
voxel by voxel. Below: the GP map's probability that something is there, faded to grey where nothing is known, and
the class of what is there, as strong as it is likely to be there. The robot's places are marked.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.octomap import SemanticOctoMap
from semgp.prediction import UNKNOWN, OccupancyPrediction
from semgp.scene.building import SyntheticBuilding

Array = NDArray[np.float64]
Extent = tuple[float, float, float, float]

HEIGHT, STEP, RESOLUTION = 0.65, 0.03, 0.1
BLUE, RED, GREY = np.array([0.23, 0.44, 0.72]), np.array([0.76, 0.15, 0.12]), np.array([0.82, 0.82, 0.8])


def blended(occupancy: OccupancyPrediction, shape: tuple[int, int]) -> Array:
    """From blue, free, over white to red, occupied; grey where nothing is known."""
    p = occupancy.probability[:, None]
    colour = np.where(p < 0.5, BLUE + 2 * p * (1 - BLUE), RED + 2 * (1 - p) * (1 - RED))
    colour[~occupancy.known] = GREY
    return np.asarray(colour.reshape(*shape, 3))


def panel(axes: Axes, picture: Array, extent: Extent, places: Array, title: str) -> None:
    axes.imshow(picture, origin="lower", extent=extent, interpolation="nearest")
    axes.plot(*places.T, "k^", markersize=5, markerfacecolor="white")
    axes.set(title=title, xticks=[], yticks=[])


def main(out: Path) -> None:
    building = SyntheticBuilding(seed=0)
    places = building.reachable(0.3, spacing=0.5)
    places = places[np.random.default_rng(3).permutation(len(places))[:7]]
    gp = GPSemanticMap(building.classes, replace(GENERAL, resolution=RESOLUTION), free=FreeSpace())
    octomap = SemanticOctoMap(building.classes, RESOLUTION)
    for i, place in enumerate(places):
        cloud = building.scan(building.pose(place), number=i)
        gp.update(cloud)
        octomap.update(cloud)

    x, y = (np.arange(STEP / 2, size, STEP) for size in building.size[:2])
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    points = np.column_stack([grid.reshape(-1, 2), np.full(grid[..., 0].size, HEIGHT)])
    shape, extent = grid.shape[:2], (0.0, float(building.size[0]), 0.0, float(building.size[1]))
    answer, rival = gp.query(points), octomap.occupancy(points)
    assert answer.occupancy is not None
    solid = ~building.is_free(points[:, :2], 0.0)
    truth = np.where(solid[:, None], (0.25, 0.25, 0.25), (1.0, 1.0, 1.0)).reshape(*shape, 3)
    palette = building.classes.palette / 255
    strength = (answer.occupancy.probability * answer.occupancy.known)[:, None]
    classes = (1 - strength) + strength * palette[answer.probability.argmax(axis=1)]
    classes[answer.occupancy.state == UNKNOWN] = GREY

    figure = Figure(figsize=(13, 10.4), layout="constrained")
    axes = figure.subplots(2, 2)
    panel(axes[0, 0], truth, extent, places, "what stands there, and where it was scanned from")
    panel(axes[0, 1], blended(rival, shape), extent, places, f"Semantic OctoMap, {100 * RESOLUTION:.0f} cm")
    panel(
        axes[1, 0], blended(answer.occupancy, shape), extent, places, "GP map: probability that something is there"
    )
    panel(axes[1, 1], classes.reshape(*shape, 3), extent, places, "GP map: class of what is there")
    states = ((RED, "occupied"), (BLUE, "free"), (GREY, "unknown"))
    keys = [Patch(color=tuple(colour.tolist()), label=state) for colour, state in states]
    seen = np.unique(answer.label[answer.occupancy.state > 0])
    keys += [Patch(color=palette[c], label=building.classes.names[c]) for c in seen if c >= 0]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), frameon=False)
    FigureCanvasAgg(figure)
    figure.savefig(out)
    known = answer.occupancy.known
    right = (answer.occupancy.probability >= 0.5) == solid
    print(f"known: {known.mean():.3f} of the slice, and of that {right[known].mean():.3f} right; picture in {out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("free_space.png"))
    main(parser.parse_args().out)
