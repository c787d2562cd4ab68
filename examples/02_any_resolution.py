"""One map, asked at any resolution: the same part of a wall every 20 cm, 5 cm and 5 mm, and a voxel map beside it.

    uv run examples/02_any_resolution.py --out any_resolution.png

Twelve views of a synthetic room make a GP map and a Semantic OctoMap, both with voxels of 5 cm. The window is
then asked on a grid in the plane of the wall. Below, the entropy of the finest answers. The voxel map's answer is
that of the voxel a point lies in, however finely it is asked. The GP's has no steps; its entropy is high where
classes meet, and its latent deviation where no label is near.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

import semgp
from semgp.maps.protocol import SemanticMap
from semgp.prediction import Prediction

Array = NDArray[np.floating]

WALL = 2.29  # y of the plane: one centimetre before the wall with the window
LOW, HIGH = (-1.3, 0.7), (0.9, 2.4)  # corners of the part of it, x and z
STEPS = (0.2, 0.05, 0.005)


def ask(semantic_map: SemanticMap, step: float) -> tuple[Prediction, tuple[int, ...]]:
    """Return what a map says every `step` metres of the part of the wall, and the shape of the grid."""
    x, z = (np.arange(a + step / 2, b, step) for a, b in zip(LOW, HIGH, strict=True))
    X, Z = np.meshgrid(x, z)
    return semantic_map.query(np.column_stack([X.ravel(), np.full(X.size, WALL), Z.ravel()])), X.shape


def panel(axes: Axes, picture: Array, title: str) -> None:
    extent = (LOW[0], HIGH[0], LOW[1], HIGH[1])
    axes.imshow(picture, origin="lower", extent=extent, interpolation="nearest", vmin=0, vmax=1.2, cmap="magma")
    axes.set(title=title, xticks=[], yticks=[])


def main(out: Path) -> None:
    room = semgp.synthetic_room(seed=0)
    maps: dict[str, SemanticMap] = {
        "GP map": semgp.GPSemanticMap(room.classes),
        "OctoMap": semgp.SemanticOctoMap(room.classes, resolution=0.05),
    }
    for view in range(0, 24, 2):
        for semantic_map in maps.values():
            semantic_map.update(room.scan(view).observed)

    palette = np.vstack([room.classes.palette, (205, 205, 205)]) / 255  # grey for label -1: not observed
    figure = Figure(figsize=(13, 9.6), layout="constrained")
    axes = figure.subplots(3, 3)
    seen = set()
    for row, (name, semantic_map) in enumerate(maps.items()):
        for column, step in enumerate(STEPS):
            answer, shape = ask(semantic_map, step)
            seen |= set(answer.label.tolist())
            title = f"{name}, every {100 * step:g} cm: {len(answer):,} points"
            panel(axes[row, column], palette[answer.label].reshape(*shape, 3), title)
    for column, (name, semantic_map) in enumerate(maps.items()):
        answer, shape = ask(semantic_map, STEPS[-1])
        panel(axes[2, column], answer.entropy.reshape(shape), f"{name}: entropy")
        if answer.variance is not None:
            deviation = np.sqrt(answer.variance.mean(axis=1))
            panel(axes[2, 2], (deviation / deviation.max()).reshape(shape), f"{name}: latent deviation")
    names = (*room.classes.names, "not observed")
    keys = [Patch(color=tuple(palette[c]), label=names[c]) for c in sorted(seen, key=lambda c: c % len(names))]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), frameon=False)
    FigureCanvasAgg(figure)
    figure.savefig(out)
    print(f"picture in {out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("any_resolution.png"))
    main(parser.parse_args().out)
