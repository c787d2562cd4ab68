"""Scans whose poses are wrong: what it helps a map to know how wrong they may be.

    uv run examples/05_uncertain_poses.py --out uncertain_poses.png

A car's lidar scans a synthetic town, but each pose is off by decimetres and up to a degree, so that each scan's
labels lie beside those of the others. Above: the town from above, the points of one stretch in the colours of
their true classes, and which of them a map gets wrong that takes the poses as right, and one that gets their
covariance. Below: log-loss and accuracy at the true places, for growing errors.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.evaluation.displaced import displaced
from semgp.evaluation.scores import score
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.scene.lidar import Lidar
from semgp.scene.town import SyntheticTown

Array = NDArray[np.float64]

ERRORS = ((0.1, 0.2), (0.2, 0.4), (0.3, 0.6), (0.5, 1.0))  # metres, degrees
SHOWN = 3
MIDDLE = np.array([52.0, -3.0, 0.0])


def mapped(scans: list[LabelledCloud], classes: Classes) -> GPSemanticMap:
    made = GPSemanticMap(classes, OUTDOOR_LIDAR)
    for cloud in scans:
        made.update(cloud)
    return made


def seen_from_above(axes: Axes, points: Array, colours: Array, title: str) -> None:
    x, y = (points - MIDDLE)[:, :2].T
    shown = (np.abs(x) < 24) & (np.abs(y) < 14)
    order = np.argsort(points[shown, 2])
    axes.scatter(x[shown][order], y[shown][order], s=1.2, c=colours[shown][order], linewidths=0)
    axes.set(title=title, xticks=[], yticks=[], aspect="equal", xlim=(-24, 24), ylim=(-14, 14))


def main(out: Path) -> None:
    town = SyntheticTown(seed=2, lidar=Lidar(beams=48, columns=720, reach=50.0))
    taken = [town.scan(i) for i in range(0, 60, 4)]
    points = np.concatenate([scan.truth.points for scan in taken])
    labels = np.concatenate([scan.truth.hard_labels for scan in taken])
    drawn = np.random.default_rng(0).permutation(len(points))[:150_000]
    points, labels = points[drawn], labels[drawn]
    palette = town.classes.palette / 255
    figure = Figure(figsize=(14, 7.6), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=(1.3, 1))
    upper, lower = parts
    panels = upper.subplots(1, 3)
    seen_from_above(panels[0], points, palette[labels], "true classes")
    found: dict[str, list[tuple[float, float]]] = {"poses taken as right": [], "covariance known": []}
    for k, (metres, degrees) in enumerate(ERRORS):
        rng = np.random.default_rng(1)
        known = [displaced(scan.observed, metres, degrees, rng) for scan in taken]
        ignored = [replace(cloud, pose_covariance=None) for cloud in known]
        for panel, (name, rows), scans in zip(panels[1:], found.items(), (ignored, known), strict=True):
            answer = mapped(scans, town.classes).query(points)
            s = score(answer.probability, answer.observed, labels)
            rows.append((s.nll, s.accuracy))
            print(f"errors of {metres} m, {degrees} deg, {name}: NLL {s.nll:.3f}, accuracy {s.accuracy:.3f}")
            if k == SHOWN:
                wrong = (answer.label != labels)[:, None]
                colours = np.where(wrong, (0.8, 0.05, 0.1), 1 - 0.25 * (1 - palette[labels]))
                seen_from_above(panel, points, colours, f"{name}, {metres} m, {degrees:g}°: wrong in red")
    names = [f"{metres} m, {degrees:g}°" for metres, degrees in ERRORS]
    for measure, (panel, title) in enumerate(
        zip(lower.subplots(1, 2), ("log-loss, nats", "accuracy"), strict=True)
    ):
        for colour, (name, rows) in zip(("#8a8a84", "#c4161c"), found.items(), strict=True):
            panel.plot(names, [row[measure] for row in rows], "o-", color=colour, label=name)
        panel.set_title(title)
        panel.grid(alpha=0.3)
        panel.legend(frameon=False)
    keys = [Patch(color=palette[c], label=name) for c, name in enumerate(town.classes.names)]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), frameon=False)
    FigureCanvasAgg(figure)
    figure.savefig(out)
    print(f"picture in {out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("uncertain_poses.png"))
    main(parser.parse_args().out)
