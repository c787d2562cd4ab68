"""How builds and queries of stored maps scale: measured on this machine, fitted, and carried on to a city.

    uv run python benchmarks/scaling.py [--clouds 32] [--repeat 2] [--no-ray] > tables.md

Lidar scans of `SyntheticTown` are written to files first. Then are measured, with one and two workers, threads and
Ray: builds of a store with and without free space, and a query of it. One process alone gives the costs of each
step as functions of clouds, points, sites, tiles and classes. `benchmarks/schedule.py` puts these together to
builds, here compared with those that were measured, and for a city extrapolated.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from costs import by_classes, cost_model
from saved_clouds import Saved, new_store, save
from schedule import Cluster, Costs, build_seconds
from semgp.evaluation.measure import peak_memory_mb, reset_peak_memory
from semgp.executors import Executor, Threads, open_executor
from semgp.store import Manifest, build
from semgp.store.asking import query
from semgp.store.building import BATCH
from tables import best, table

CITY = 1e10  # points
ROW = 95  # bytes of a tile in a manifest


def scaling(saved: Saved, folder: Path, repeat: int, with_ray: bool) -> dict[tuple[str, int], float]:
    """Measure strong and weak scaling, print both, and return the seconds of builds."""
    asked = new_store(folder, saved.settings)
    build(asked, saved, Threads(), batch=len(saved))
    X = np.concatenate([saved[i].points for i in range(0, len(saved), 6)])
    half = replace(saved, n=len(saved) // 2)
    strong, weak, builds = [], [], {}
    alone: dict[str, float] = {}
    for name in ("threads", "ray") if with_ray else ("threads",):
        for workers in (1, 2):
            with open_executor(name, workers) as executor:
                _warm(executor, saved, folder)
                seconds = {
                    "build s": best(partial(_build, folder, saved, executor), repeat),
                    "with free space s": best(partial(_build, folder, replace(half, free=True), executor), repeat),
                    "query s": best(partial(query, asked, X, executor), repeat),
                }
                some = saved if workers == 2 else half
                seconds_weak = best(partial(_build, folder, some, executor), repeat)
            builds[name, workers] = seconds["build s"]
            if workers == 1:
                alone = seconds | {"weak": seconds_weak}
            speed = {k.removesuffix(" s") + " ×": alone[k] / v for k, v in seconds.items()}
            strong.append({"executor": name, "workers": workers, **seconds, **speed})
            weak.append({"executor": name, "workers": workers, "clouds": len(some), "build s": seconds_weak,
                         "efficiency": alone["weak"] / seconds_weak})  # fmt: skip
    table(f"Strong scaling: {len(saved)} clouds ({len(half)} with free space), {len(X):,} points asked.", strong)
    table("Weak scaling: twice the clouds for two workers.", weak)
    return builds


def _build(folder: Path, saved: Saved, executor: Executor) -> Manifest:
    return build(new_store(folder, saved.settings), saved, executor)


def _warm(executor: Executor, saved: Saved, folder: Path) -> None:
    """Have every worker load compiled code."""
    for some in (replace(saved, n=4), replace(saved, n=4, free=True)):
        store = new_store(folder, some.settings)
        build(store, some, executor, batch=2)
        query(store, saved[0].points[:1000], executor)


def ray_overhead() -> tuple[float, float]:
    """Return the seconds that a task and a part cost the process that asks, by shuffles of nothing with Ray."""
    with open_executor("ray", 2) as executor:
        executor.shuffle(partial(_nothing, n_parts=20), range(4), len, 20)
        few, many = (
            best(partial(executor.shuffle, partial(_nothing, n_parts=n), range(32), len, n), 3) for n in (20, 200)
        )
    # both have 32 tasks, and then 20 or 200 more; and 640 or 6,400 parts
    reference = max(0.0, (many - few) / 5760)
    task = max(0.0, few - 640 * reference) / 52
    print(f"\nRay: {1e3 * task:.2f} ms a task and {1e6 * reference:.0f} µs a part for the process that asks.")
    return task, reference


def _nothing(_: int, n_parts: int) -> list[int]:
    return [0] * n_parts


def city(costs: Costs, points_a_cloud: float, free: str) -> None:
    """Print what the costs make of a city."""
    clouds = round(CITY / points_a_cloud)
    sites, tiles = clouds * costs.new_sites, clouds * costs.new_tiles
    print(
        f"\nA city of {CITY:.0e} points {free} free space, extrapolated: {clouds:,} clouds a metre apart, "
        f"{sites / 1e6:,.0f} million sites, {tiles:,.0f} tiles, {sites * costs.tile_bytes / 1e9:,.1f} GB in the "
        f"newest version, its manifest {tiles * ROW / 1e6:.1f} MB; {clouds * np.mean(costs.cloud) / 3600:.1f} "
        "hours of one core for the sums alone."
    )
    rows = []
    for machines in (1, 4, 16, 64, 256):
        cluster = Cluster(16 * machines)
        seconds = build_seconds(costs, cluster, clouds)
        ideal = clouds * float(np.mean(costs.cloud)) / cluster.workers
        rows.append({
            "machines of 16 cores": machines, "minutes": seconds / 60, "machine-hours": machines * seconds / 3600,
            "versions": -(-clouds // (BATCH * cluster.workers)), "share of the sums": ideal / seconds,
            "parts of a version, million": 8 * cluster.workers**2 / 1e6,
        })  # fmt: skip
    table("The same on more and more machines, simulated.", rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--clouds", type=int, default=32)
    parser.add_argument("--repeat", type=int, default=2)
    parser.add_argument("--no-ray", action="store_true", help="threads only")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        saved = save(folder, options.clouds)
        points = float(np.mean([len(saved[i]) for i in range(0, len(saved), 4)]))
        print(f"{os.cpu_count()} cores; {len(saved)} clouds of {points:,.0f} points.")
        reset_peak_memory()
        costs, with_free = cost_model(saved, folder), cost_model(replace(saved, free=True), folder)
        table("Classes: the same clouds, their labels spread over more classes.", list(by_classes(saved, folder)))
        print(f"\nPeak memory of this process in all that: {peak_memory_mb():,.0f} MB.", flush=True)
        builds = scaling(saved, folder, options.repeat, not options.no_ray)
        task, reference = (0.0, 0.0) if options.no_ray else ray_overhead()
        rows = []
        for (name, workers), measured in builds.items():
            used = replace(costs, task=task, reference=reference) if name == "ray" else costs
            simulated = build_seconds(used, Cluster(workers), len(saved))
            rows.append({"executor": name, "workers": workers, "measured s": measured, "simulated s": simulated,
                         "measured / simulated": measured / simulated})  # fmt: skip
        table("The simulation against what was measured.", rows)
        print("\n## A city")
        for used in (costs, with_free):
            city(replace(used, task=task, reference=reference), points, "with" if used is with_free else "without")


if __name__ == "__main__":
    main()
