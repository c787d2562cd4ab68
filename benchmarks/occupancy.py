"""Free space in the GP map against the Semantic OctoMap: agreement, log-loss of a scan held out, cost.

    uv run benchmarks/occupancy.py DATA

DATA is the folder that holds `semantickitti_08` and `nyu`. On SemanticKITTI the map is built from the scans; of an
NYU frame, whose pixels are one view, ten interleaved parts stand for ten scans. The OctoMap is certain of voxels
whose log-odds have reached a clamp. The scan held out is asked at a point on each of many rays, drawn evenly
between sensor and one voxel before the end (free), and at the ends (occupied).
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from semgp.cloud import LabelledCloud
from semgp.evaluation.semantic_kitti import VERTICAL, kitti_sequence
from semgp.maps.free_space import FreeSpace, occupancy_model
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import INDOOR_RGBD, OUTDOOR_LIDAR, with_vertical
from semgp.maps.protocol import SpatialMap
from semgp.octomap import SemanticOctoMap
from semgp.octomap.sensor import SensorModel, log_odds
from semgp.readers.nyu import NYUFolder

HELD_OUT = 5
MOST = 200_000


def held_out(cloud: LabelledCloud, resolution: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points on the rays, free, and their ends, occupied."""
    assert cloud.origin is not None
    rng = np.random.default_rng(0)
    d = cloud.points - cloud.origin
    r = np.linalg.norm(d, axis=1)
    rows = rng.choice(np.flatnonzero(r > 2 * resolution), min(MOST, len(d)))
    t = rng.random(len(rows)) * (r[rows] - resolution)
    return cloud.origin + d[rows] * (t / r[rows])[:, None], cloud.points[rows]


def log_loss(
    spatial_map: SpatialMap, free: NDArray[np.float64], occupied: NDArray[np.float64]
) -> tuple[float, ...]:
    """Return the mean log-loss at free points, at occupied ones, and their mean."""
    losses = []
    for points, right in ((free, 0), (occupied, 1)):
        occupancy = spatial_map.query(points).occupancy
        assert occupancy is not None
        p = occupancy.probability if right else 1 - occupancy.probability
        losses.append(float(-np.log(np.maximum(p, 1e-6)).mean()))
    return *losses, (losses[0] + losses[1]) / 2


def compare(name: str, scans: Sequence[LabelledCloud], gp: GPSemanticMap, octomap: SemanticOctoMap) -> None:
    bare = GPSemanticMap(gp.classes, gp.model)
    seconds = []
    for semantic_map in (bare, gp):
        start = perf_counter()
        for cloud in scans:
            semantic_map.update(cloud)
        semantic_map.solve()
        seconds.append(perf_counter() - start)
    for cloud in scans:
        octomap.update(cloud)
    cells, sensor = octomap.leaves(pruned=False), SensorModel()
    print(f"{name}: {gp.info()['free_sites']:,} sites of free space, {len(gp):,} of labels")
    print(
        f"  seconds to build: labels {seconds[0]:.2f}, with free space {seconds[1]:.2f}:"
        f" {seconds[1] / seconds[0]:.1f} times"
    )
    total, agreed = 0, 0.0
    for what, clamp in (("occupied", sensor.clamp_max), ("free", sensor.clamp_min)):
        chosen = np.flatnonzero(np.abs(cells.log_odds - log_odds(clamp)) < 1e-3)
        drawn = np.random.default_rng(0).permutation(chosen)[:MOST]
        occupancy = gp.query(cells.centres[drawn]).occupancy
        assert occupancy is not None
        same = float(((occupancy.probability >= 0.5) == (what == "occupied")).mean())
        total, agreed = total + len(chosen), agreed + same * len(chosen)
        print(
            f"  certainly {what}: {len(chosen):,} voxels, agreement {same:.4f}, known {occupancy.known.mean():.4f}"
        )
    print(f"  agreement on all of them: {agreed / total:.4f}")
    maps: list[tuple[str, SpatialMap]] = [
        ("GP", GPSemanticMap(gp.classes, gp.model, free=gp.free)),
        ("OctoMap", SemanticOctoMap(gp.classes, octomap.resolution)),
    ]
    free, occupied = held_out(scans[HELD_OUT], octomap.resolution)
    for method, spatial_map in maps:
        for i, cloud in enumerate(scans):
            if i != HELD_OUT:
                spatial_map.update(cloud)
        a, b, mean = log_loss(spatial_map, free, occupied)
        print(f"  log-loss of scan {HELD_OUT}, {method}: free {a:.4f}, occupied {b:.4f}, mean {mean:.4f}")


def main(data: Path) -> None:
    sequence = kitti_sequence(data / "semantickitti_08")
    scans = [sequence.scan(i, "predictions") for i in range(len(sequence))]
    model = with_vertical(OUTDOOR_LIDAR, VERTICAL)
    free = FreeSpace(occupancy_model(model.resolution, VERTICAL))
    gp = GPSemanticMap(scans[0].classes, model, free=free)
    compare("SemanticKITTI 08", scans, gp, SemanticOctoMap(gp.classes, model.resolution))
    frames = NYUFolder(data / "nyu")
    for number in (282, 374, 555, 965):
        cloud = frames.read(number).cloud
        parts = [cloud[i::10] for i in range(10)]
        gp = GPSemanticMap(cloud.classes, INDOOR_RGBD, free=FreeSpace())
        compare(f"NYU {number}", parts, gp, SemanticOctoMap(cloud.classes, INDOOR_RGBD.resolution))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
