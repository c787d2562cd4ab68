"""Learn the presets of `semgp.maps.presets`, and print them as JSON.

    uv run python benchmarks/learn_presets.py [--seed 0]

general comes from six synthetic rooms, whose true labels judge maps of the observed ones. outdoor-lidar comes from
the ten scans of SemanticKITTI 08 with a network's labels, which judge each other; no true label is used.
indoor-rgbd and indoor-labels come from eight frames of NYU Depth V2 with the labels of a network, and with few
true ones; the frames' true labels judge. The data are read from $SEMGP_DATA or ../shared/data beside the checkout.
The class priors are left out: presets are for any classes.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from semgp.blocks.learning import learn_blocks, learn_from_scans
from semgp.blocks.model import BlockModel
from semgp.evaluation.nyu_blocks import NYUBlocks
from semgp.evaluation.semantic_kitti import START
from semgp.readers import SemanticKITTISequence, open_nyu
from semgp.scene import synthetic_room

DEFAULT_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    seed = parser.parse_args().seed
    data = Path(os.environ.get("SEMGP_DATA", DEFAULT_DATA))
    sequence = SemanticKITTISequence(data / "semantickitti_08")
    scans = [sequence.scan(i, "predictions") for i in range(len(sequence))]
    frames = NYUBlocks(open_nyu(data / "nyu"), seed=seed)
    rooms = [synthetic_room(room).scan(0) for room in range(1, 7)]
    trials = [([room.observed], [room.truth[::7]]) for room in rooms]
    even = replace(BlockModel(), prior=(1.0,) * len(rooms[0].truth.classes))
    presets: dict[str, BlockModel] = {
        "general": learn_blocks(trials, even, spread=1.0, max_iterations=20, seed=seed)[0],
        "outdoor-lidar": learn_from_scans(scans, START, vertical=2, seed=seed)[0],
        "indoor-rgbd": frames.model("noisy")[0],
        "indoor-labels": frames.model("sparse")[0],
    }
    plain = {name: replace(model, prior=None).to_json() for name, model in presets.items()}
    Console().print_json(json.dumps(plain))


if __name__ == "__main__":
    main()
