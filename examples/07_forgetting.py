"""What moves leaves no ghost: a map that forgets, and gives up the places that rays pass through.

    uv run examples/07_forgetting.py --out forgetting.png

A lidar at a roadside scans a street on which a car drives by and another one stays parked. A map of all labels
keeps the car in every place where it ever was. One that keeps free space knows better where later rays have
passed; one that forgets as well has given the car's labels up there, too. Each row is one map, after three, eight
and sixteen scans: places where something is, seen from above, in the colours of their classes.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.maps.forgetting import Forgetting
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.prediction import FREE
from semgp.scene.lidar import Lidar
from semgp.scene.raycast import BOX, Solids

Array = NDArray[np.float64]

STREET = Classes(("road", "building", "car"), ((90, 90, 96), (214, 158, 62), (206, 42, 52)))
LIDAR = Lidar(beams=40, columns=900, top=4.0, bottom=-28.0, reach=45.0, noise=0.02)
SCANS, SHOWN = 16, (3, 8, 16)
STEP = 2.0  # metres that the car drives between two scans
PARKED = np.array([6.0, 6.4, 0.8])


def driving(i: int) -> Array:
    return np.array([-14.0 + STEP * i, 2.2, 0.8])


def scan(i: int) -> LabelledCloud:
    """What the lidar sees while the car is at its i-th place."""
    centres = np.array([[0, 0, -0.5], [0, 12, 4], [0, -9, 4], driving(i), PARKED])
    halves = np.array([[40, 20, 0.5], [40, 1, 4], [40, 1, 4], [2.1, 0.9, 0.75], [2.1, 0.9, 0.75]])
    solids = Solids(np.full(5, BOX), centres, halves, np.zeros(5))
    T_world_sensor = np.eye(4)
    T_world_sensor[:3, 3] = 0, -3, 2
    points, solid = LIDAR.measure(solids, T_world_sensor, np.random.default_rng(i))
    return LabelledCloud(points, STREET, np.array([0, 1, 1, 2, 2])[solid], T_world_sensor=T_world_sensor)


def there(made: GPSemanticMap, places: Array) -> NDArray[np.int32]:
    """Class of what the map says is at places; -1 where nothing is."""
    answer = made.query(places)
    label = answer.label
    if answer.occupancy is not None:
        label = np.where(answer.occupancy.state == FREE, -1, label).astype(np.int32)
    return label


def main(out: Path) -> None:
    free = FreeSpace()
    maps = {
        "all labels": GPSemanticMap(STREET, OUTDOOR_LIDAR),
        "with free space": GPSemanticMap(STREET, OUTDOOR_LIDAR, free=free),
        "with free space, forgetting": GPSemanticMap(STREET, OUTDOOR_LIDAR, free=free, forgetting=Forgetting(10)),
    }
    seen, places = [scan(i) for i in range(SCANS)], np.empty((0, 3))
    figure = Figure(figsize=(13, 8), layout="constrained")
    axes: Any = figure.subplots(len(maps), len(SHOWN))
    for i, cloud in enumerate(seen, start=1):
        for made in maps.values():
            made.update(cloud)
        places = np.concatenate([places, cloud.points[cloud.hard_labels == 2]])
        if i not in SHOWN:
            continue
        now = driving(i - 1)
        old = places[(np.abs(places - now) > (2.6, 1.4, 2)).any(axis=1) & (np.abs(places - PARKED)[:, 1] > 1.4)]
        for row, (name, made) in enumerate(maps.items()):
            ghosts = float((there(made, old) == 2).mean())
            print(f"after {i} scans, {name}: {ghosts:.3f} of the places where the car was are still a car")
            X = made.positions
            label = there(made, X)
            panel = axes[row, SHOWN.index(i)]
            shown = (label >= 0) & (X[:, 2] < 2)
            order = np.argsort(X[shown, 2])
            colours = STREET.palette[label[shown]][order] / 255
            panel.scatter(*X[shown][order, :2].T, s=2, c=colours, linewidths=0)
            title = f"{name}: {100 * ghosts:.0f} % ghosts" if i > SHOWN[0] else f"{name}, {i} scans"
            panel.set(title=title, xlim=(-20, 24), ylim=(-9, 12), aspect="equal", xticks=[], yticks=[])
            panel.plot(0, -3, "k^", markersize=6, markerfacecolor="white")
    keys = [Patch(color=c / 255, label=name) for name, c in zip(STREET.names, STREET.palette, strict=True)]
    figure.legend(handles=keys, loc="outside lower center", ncols=3, frameon=False)
    FigureCanvasAgg(figure)
    figure.savefig(out)
    print(f"picture in {out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("forgetting.png"))
    main(parser.parse_args().out)
