"""A first map: one scan of a room, a few of its labels, some of those wrong; and the map's answer everywhere.

    uv run examples/01_first_map.py --out first_map.png

A depth camera looks into a synthetic room. One pixel in nine keeps its label, whole patches have none, others a
wrong one. The map is asked at every pixel. The picture shows the truth, what the map was given, what it says, and
where it is unsure.
"""

import argparse
from pathlib import Path

import numpy as np

import semgp
from semgp.picture import by_class, by_value, disc_sizes, legend, panels, save_png, splat, stack, view_of


def main(out: Path) -> None:
    scan = semgp.synthetic_room(seed=0).scan(0)
    given, truth = scan.observed, scan.truth

    room = semgp.GPSemanticMap(given.classes)  # the preset "general"
    room.update(given)
    answer = room.query(truth.points)

    right = (answer.label == truth.hard_labels).mean()
    print(f"{given.labelled.sum():,} labels, {len(answer):,} points asked, {100 * right:.1f} % of them right")
    sure = answer.confidence > 0.9
    print(f"where its probability is above 0.9: {100 * (answer.label == truth.hard_labels)[sure].mean():.1f} %")

    view, size = view_of(truth.points, truth.origin, width=800, height=600), disc_sizes(truth.points)
    pictures = {
        "truth": by_class(truth.hard_labels, truth.classes),
        "given": by_class(given.hard_labels, given.classes),
        "the map's classes": by_class(answer.label, truth.classes),
        "its entropy, bright is unsure": by_value(answer.entropy, 0.0, float(np.log(len(truth.classes)))),
    }
    grid = panels([splat(truth.points, c, view, size) for c in pictures.values()], list(pictures), columns=2)
    save_png(out, stack([grid, legend(truth.classes, grid.shape[1], missing="no label")]))
    print(f"picture in {out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("first_map.png"))
    main(parser.parse_args().out)
