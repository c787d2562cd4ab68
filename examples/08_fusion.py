"""Two robots map two ends of a building, each in a frame of its own; their maps are joined into one.

    uv run examples/08_fusion.py --out fusion.png

Robot b has begun somewhere else and looks another way, so that its map is turned and shifted; the transform
between the two is known. Above: the two maps, each in its own frame. Below: both joined, and the map that one
robot would have made of all scans. All are asked in a slice 90 cm above the floor: the colour is the class, as
strong as something of it is likely to be there; grey is unknown.
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
from scipy.spatial.transform import Rotation

from semgp.cloud import LabelledCloud
from semgp.evaluation.displaced import moved
from semgp.maps.free_space import FreeSpace
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.prediction import UNKNOWN, Prediction
from semgp.scene.building import SyntheticBuilding

Array = NDArray[np.float64]

HEIGHT, STEP = 0.9, 0.05
MODEL = replace(GENERAL, resolution=0.1)


def frame_of_b() -> Array:
    """T_a_b: where robot b's frame lies in robot a's."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("z", 35, degrees=True).as_matrix()
    T[:3, 3] = 16.0, 1.0, 0.0
    return T


def mapped(scans: list[LabelledCloud]) -> GPSemanticMap:
    made = GPSemanticMap(scans[0].classes, MODEL, free=FreeSpace())
    for cloud in scans:
        made.update(cloud)
    return made


def drawn(axes: Axes, made: GPSemanticMap, low: Array, high: Array, title: str) -> Prediction:
    x, y = (np.arange(a + STEP / 2, b, STEP) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    answer = made.query(np.column_stack([grid.reshape(-1, 2), np.full(grid[..., 0].size, HEIGHT)]))
    assert answer.occupancy is not None
    strength = answer.occupancy.probability[:, None]
    colours = 1 - strength * (1 - made.classes.palette[answer.probability.argmax(axis=1)] / 255)
    colours[answer.occupancy.state == UNKNOWN] = 0.84
    axes.imshow(colours.reshape(*grid.shape[:2], 3), origin="lower", extent=(low[0], high[0], low[1], high[1]))
    axes.set(title=title, xlabel="m", ylabel="m")
    return answer


def main(out: Path) -> None:
    building, T_a_b = SyntheticBuilding(seed=4), frame_of_b()
    T_b_a: Array = np.asarray(np.linalg.inv(T_a_b), dtype=np.float64)
    places = building.reachable(0.3, spacing=0.5)
    places = places[np.random.default_rng(2).permutation(len(places))[:30]]
    scans = [building.scan(building.pose(place), number=i) for i, place in enumerate(places)]
    west = [cloud for cloud, place in zip(scans, places, strict=True) if place[0] < 11]
    east = [cloud for cloud, place in zip(scans, places, strict=True) if place[0] > 9]
    a, b = mapped(west), mapped([moved(cloud, T_b_a) for cloud in east])
    joined, single = fuse(a, b, T_a_b), mapped(west + east)

    figure = Figure(figsize=(13, 11.5), layout="constrained")
    axes = figure.subplots(2, 2)
    low, high = np.array([-0.5, -0.5]), building.size[:2] + 0.5
    corners = np.array([[x, y, 0.0] for x in (low[0], high[0]) for y in (low[1], high[1])])
    seen_by_b = (corners - T_a_b[:3, 3]) @ T_a_b[:3, :3]
    drawn(axes[0, 0], a, low, high, f"robot a: {len(west)} scans, {len(a):,} sites")
    b_low, b_high = seen_by_b.min(axis=0)[:2], seen_by_b.max(axis=0)[:2]
    drawn(axes[0, 1], b, b_low, b_high, f"robot b, in its own frame: {len(east)} scans, {len(b):,} sites")
    both = drawn(axes[1, 0], joined, low, high, f"joined: {len(joined):,} sites")
    all_of_it = drawn(axes[1, 1], single, low, high, f"one map of all scans: {len(single):,} sites")
    palette = building.classes.palette / 255
    keys = [Patch(color=tuple(palette[c]), label=name) for c, name in enumerate(building.classes.names)]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), frameon=False)
    FigureCanvasAgg(figure)
    figure.savefig(out)
    assert both.occupancy is not None
    assert all_of_it.occupancy is not None
    same = both.occupancy.state == all_of_it.occupancy.state
    apart = np.abs(both.occupancy.probability - all_of_it.occupancy.probability)
    straight = fuse(a, mapped(east))
    X = single.positions[:5000]
    exact = np.abs(straight.query(X).probability - single.query(X).probability).max()
    print(f"one frame: joined and single map differ by {exact:.1g} at most")
    print(f"two frames: {same.mean():.3f} of the slice in the same state, mean difference {apart.mean():.3f}")
    print(f"picture in {out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("fusion.png"))
    main(parser.parse_args().out)
