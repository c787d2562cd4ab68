"""How far labels can be trusted, learned without any truth from what scans say of the places that they share.

    uv run examples/04_label_reliability.py --out label_reliability.png

A car scans a street. Its network takes some classes for others, and the farther away a point is, the more often it
says anything at all; patches of half a metre get one error in each scan. From how scans agree, semgp learns how
much a label counts by its range, and which classes are said for which.

Above: confidence by range, and what is said of each class, as learned and as counted with the truth, which is not
used for learning. Of rare classes little can be learned: they stay near what is believed beforehand. Below: maps
of the same scans, with labels that all count alike, or as far as they can be trusted; one point a voxel is scored.
Trust by range clears up what is far; trust by class brings back what is said less often than it is there.
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

from semgp import PRESETS, GPSemanticMap, LabelledCloud
from semgp.evaluation.scores import score
from semgp.picture import View, by_class, splat
from semgp.reliability.agreement import sensor_ranges
from semgp.reliability.confusion import learn_confusion
from semgp.reliability.evidence import evidence, probability_right
from semgp.reliability.ranges import RangeConfidence, learn_range_confidence
from semgp.scene.lidar import Lidar, PatchFaults
from semgp.scene.town import SyntheticTown
from semgp.voxels import voxel_keys

Array = NDArray[np.float64]

TOWN = SyntheticTown(seed=0, lidar=Lidar(columns=800, reach=50), faults=PatchFaults(wrong=0))
CLASSES, C = TOWN.classes, len(TOWN.classes)
LAW, NEAREST_RIGHT, PATCH = RangeConfidence(range_0=20, power=3), 0.95, 0.5
SAID_FOR = (
    *(("sidewalk", "parking", 0.4), ("terrain", "parking", 0.3), ("building", "fence", 0.4)),
    *(("vegetation", "fence", 0.4), ("trunk", "pole", 0.3), ("car", "fence", 0.1)),
)
VIEW = View.look_at((45, -78, 78), (45, 1, 0), fov=31, width=900, height=520)


def mistaken(truth: LabelledCloud, seed: int) -> LabelledCloud:
    """Return a scan as the network labels it: errors by class, then by range, alike all over a patch."""
    said_for = np.eye(C)
    for true, said, share in SAID_FOR:
        said_for[CLASSES.index(true), [CLASSES.index(true), CLASSES.index(said)]] += -share, share
    patches, patch = np.unique(voxel_keys(truth.points, PATCH), return_inverse=True)
    chance, luck, other = np.random.default_rng(seed).random((3, len(patches)))[:, patch]
    label = (chance[:, None] > said_for.cumsum(axis=1)[truth.hard_labels, :-1]).sum(axis=1)
    right = probability_right(LAW.at(sensor_ranges(truth)) * evidence(NEAREST_RIGHT, C), C)
    anything = (label + 1 + np.floor((C - 1) * other).astype(int)) % C
    return replace(truth, labels=np.where(luck < right, label, anything))


def counted(truth: LabelledCloud, said: LabelledCloud, ranges: Array) -> tuple[Array, Array, Array]:
    """Return some ranges and the confidence that they deserve, and what is said of each class, by the truth."""
    edges = np.geomspace(4, 50, 16)
    at = np.searchsorted(edges, ranges)
    right = truth.hard_labels == said.hard_labels
    worth = evidence([right[at == i].mean() for i in range(1, len(edges))], C)
    table = np.bincount(C * truth.hard_labels + said.hard_labels, minlength=C * C).reshape(C, C)
    return np.sqrt(edges[1:] * edges[:-1]), worth / worth.max(), table / table.sum(axis=1, keepdims=True)


def joined(scans: list[LabelledCloud]) -> LabelledCloud:
    points, labels = zip(*((scan.points, scan.hard_labels) for scan in scans))
    return LabelledCloud(np.concatenate(points), CLASSES, np.concatenate(labels))


def show_matrix(axes: Axes, matrix: Array, title: str) -> None:
    axes.imshow(matrix, cmap="Blues", vmin=0, vmax=1)
    for (row, column), p in np.ndenumerate(matrix):
        if p >= 0.05:
            colour = "white" if p > 0.6 else "black"
            axes.text(column, row, f"{100 * p:.0f}", ha="center", va="center", size=8, color=colour)
    axes.set_xticks(range(C), CLASSES.names, rotation=50, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(C), CLASSES.names)
    axes.set(title=title, xlabel="said", ylabel="true")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("label_reliability.png"))
    out = parser.parse_args().out

    truth = [TOWN.scan(i).truth for i in range(0, 80, 4)]
    said = [mistaken(scan, seed) for seed, scan in enumerate(truth)]
    law, confusion = learn_range_confidence(said), learn_confusion(said)
    every = joined(truth)
    ranges, worth, table = counted(every, joined(said), np.concatenate([sensor_ranges(scan) for scan in truth]))
    print(f"{law}; off by {np.abs(law.at(ranges) - worth).mean():.3f} on average")
    print(f"confusion off by {np.abs(confusion.matrix - table).sum(axis=1) @ confusion.frequencies / 2:.3f}")

    scored = every[np.unique(voxel_keys(every.points, 0.2), return_index=True)[1]]
    weighed = [confusion.weigh(scan) for scan in said]
    ways = {
        "all labels alike": said,
        "by range": [law.apply(scan) for scan in said],
        "by class": weighed,
        "by range and class": [law.apply(scan) for scan in weighed],
    }
    labels = {"the truth": scored.hard_labels}
    for name, scans in ways.items():
        town_map = GPSemanticMap(CLASSES, PRESETS["outdoor-lidar"])
        for scan in scans:
            town_map.update(scan)
        found = town_map.query(scored.points)
        s = score(found.probability, found.observed, scored.hard_labels)
        labels[f"{name}: accuracy {s.accuracy:.1%}, mIoU {s.miou:.1%}, NLL {s.nll:.3f}"] = found.label
    print(*list(labels)[1:], sep="\n")

    figure = Figure(figsize=(16, 11.8), layout="constrained")
    FigureCanvasAgg(figure)
    curve, by_truth, learned, *panels, last = figure.subplots(3, 3, height_ratios=(1.95, 1, 1)).flatten()
    curve.plot(ranges, worth, "o", color="#f57900", label="counted with the truth")
    curve.plot(ranges, law.at(ranges), color="#3465a4", linewidth=2.5, label="learned without it")
    curve.set(title="how much a label counts", xlabel="range (m)", ylabel="confidence", ylim=(0, 1.05))
    curve.set_box_aspect(1)
    curve.legend()
    show_matrix(by_truth, table, "what is said (%), counted with the truth")
    show_matrix(learned, confusion.matrix, "what is said (%), learned without it")
    for axes, (title, label) in zip(panels, labels.items()):
        axes.imshow(splat(scored.points, by_class(label, CLASSES), VIEW, size=0.22))
        axes.set_title(title, size=11)
        axes.axis("off")
    swatches = [Patch(color=colour, label=name) for name, colour in zip(CLASSES.names, CLASSES.palette / 255)]
    last.legend(handles=swatches, loc="center", ncols=2, frameon=False, fontsize=12)
    last.axis("off")
    figure.savefig(out, dpi=110)
    print(out)


if __name__ == "__main__":
    main()
