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
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from schedule import Cluster, Costs, build_seconds
from semgp.blocks.arrays import F64
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.evaluation.measure import peak_memory_mb, reset_peak_memory, timed
from semgp.executors import Executor, Threads, open_executor
from semgp.maps.free_space import FreeSpace
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.maps.tiles import Arrays
from semgp.scene.town import SyntheticTown
from semgp.store import Manifest, MapStore, Settings, Tile, build
from semgp.store.asking import AskTiles, Piece, query
from semgp.store.building import BATCH, SumClouds, WriteTiles, _origin_of

STRIDE = 1  # metres, and scans, from one cloud to the next
CITY = 1e10  # points
ROW = 95  # bytes of a tile in a manifest


@dataclass(frozen=True)
class Saved(Sequence[LabelledCloud]):
    """Clouds in files; the first `points` of each, with labels of `n_classes` classes."""

    folder: Path
    n: int
    share: float = 1.0
    n_classes: int = 0
    free: bool = False

    def __len__(self) -> int:
        return self.n

    def __getitem__(self, i: Any) -> Any:
        with np.load(self.folder / f"{i}.npz") as file:
            keep = np.random.default_rng(i).random(len(file["points"])) < self.share
            X, labels, T = file["points"][keep], file["labels"][keep], file["T"]
        classes = self.classes
        if self.n_classes:
            spread = (X[:, 0] // 2).astype(np.int64) % max(1, self.n_classes // 11)
            labels = np.where(labels < 0, -1, (labels + 11 * spread) % self.n_classes)
        return LabelledCloud(X, classes, labels.astype(np.int32), T_world_sensor=T)

    @property
    def classes(self) -> Classes:
        """The town's, or so many."""
        return (
            Classes(tuple(f"c{k}" for k in range(self.n_classes))) if self.n_classes else SyntheticTown().classes
        )

    @property
    def settings(self) -> Settings:
        """Of a map of these clouds."""
        return Settings(self.classes, OUTDOOR_LIDAR, FreeSpace() if self.free else None)


def save(folder: Path, n: int) -> Saved:
    """Write the town's scans to files."""
    town = SyntheticTown()
    for i in range(n):
        cloud = town.scan(i * STRIDE).observed
        np.savez(folder / f"{i}.npz", points=cloud.points, labels=cloud.hard_labels, T=town.pose(i * STRIDE))
    return Saved(folder, n)


_count = count()


def new_store(folder: Path, settings: Settings) -> MapStore:
    store = MapStore(folder / f"store-{next(_count)}")
    store.create(settings)
    return store


def best(work: Callable[[], Any], repeat: int) -> float:
    """Least seconds of some runs: whatever else the machine does only adds to them."""
    return min(timed(work)[1] for _ in range(repeat))


def table(title: str, rows: Sequence[dict[str, Any]]) -> None:
    """Print a table in markdown."""
    names = list(rows[0])
    print(f"\n{title}\n\n| {' | '.join(names)} |\n|{'---|' * len(names)}")
    for row in rows:
        print(
            "| " + " | ".join(f"{v:,.3g}" if isinstance(v, float) else f"{v}" for v in row.values()) + " |",
            flush=True,
        )


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


def sums(saved: Saved, rows: range, settings: Settings) -> tuple[list[Any], float, int]:
    """Sum clouds; return the parts, seconds and sites."""
    origin = _origin_of(saved, range(1), settings)
    work = SumClouds(saved, settings, np.array(origin), 1)
    parts, seconds = timed(lambda: work(rows))
    return parts, seconds, sum(_n_sites(arrays) for arrays in parts[0].values())


def _n_sites(arrays: Arrays) -> int:
    return len(arrays["voxels"]) + len(arrays.get("free.voxels", ()))


def manifest_of(store: MapStore, saved: Saved) -> Manifest:
    return replace(store.manifest(), origin=_origin_of(saved, range(1), saved.settings))


def cost_model(saved: Saved, folder: Path) -> Costs:
    """Measure each step alone, print the fits, and return the costs."""
    sums(saved, range(4), saved.settings)  # compiled code is loaded
    rows = [
        _clouds_of(replace(saved, share=share), i) for share in (0.125, 0.25, 0.5, 1.0) for i in range(0, 8, 2)
    ]
    cloud = _fit(rows, "points", "sites")
    writes = list(_writes(saved, folder))
    write = _fit(writes, "tiles", "sent")
    ask = _fit(list(_asks(saved, folder)), "points", "sites")
    last, first = writes[-1], writes[0]
    growth = (last["sites"] - first["sites"]) / (last["clouds"] - first["clouds"])
    tiles = (last["tiles"] - first["tiles"]) / (last["clouds"] - first["clouds"])
    alone = [_clouds_of(saved, i) for i in range(len(saved))]
    mean = 1e3 * float(np.mean([r["s"] for r in alone]))
    table(f"Costs of one core, fitted, {'with' if saved.free else 'without'} free space.", [
        {"what": "a cloud, read and summed",
         "model": f"{1e9 * cloud[0]:.0f} ns a point + {1e9 * cloud[1]:.0f} ns a site; {mean:.0f} ms on average"},
        {"what": "its sites, to their tiles",
         "model": f"{1e3 * write[0]:.1f} ms a tile + {1e9 * write[1]:.0f} ns a site that is sent"},
        {"what": "a query, tiles loaded and solved",
         "model": f"{1e9 * ask[0]:.0f} ns a point + {1e9 * ask[1]:.0f} ns a site"},
        {"what": "a site on its way, and in its file",
         "model": f"{_part_bytes(saved):.0f} bytes, {last['bytes'] / last['sites']:.1f} bytes"},
        {"what": "the map grows", "model": f"{growth:,.0f} sites and {tiles:.2f} tiles a cloud, a metre apart"},
    ])  # fmt: skip
    return Costs(
        cloud=[r["s"] for r in alone], site=float(write[1]), tile=float(write[0]),
        part_bytes=_part_bytes(saved), tile_bytes=last["bytes"] / last["sites"], new_sites=growth, new_tiles=tiles,
        first_sites=first["sites"], first_tiles=first["tiles"], manifest=_manifest_seconds(saved.settings),
    )  # fmt: skip


def _fit(rows: Sequence[dict[str, Any]], *names: str) -> F64:
    """Seconds as a sum of costs, none of them negative, of what the rows count."""
    A, b = (np.array([[r[name] for name in columns] for r in rows], dtype=float) for columns in (names, ["s"]))
    scale = A.max(axis=0)
    return np.asarray(nnls(A / scale, b[:, 0])[0] / scale)


def _clouds_of(saved: Saved, i: int) -> dict[str, float]:
    seconds, sites = min(sums(saved, range(i, i + 1), saved.settings)[1:] for _ in range(3))
    return {"points": len(saved[i]), "s": seconds, "sites": sites}


def _writes(saved: Saved, folder: Path) -> Iterator[dict[str, Any]]:
    """Tiles of more and more clouds, summed four at a time."""
    for n in (1, 4, 8, len(saved)):
        parts = [sums(saved, range(i, min(i + 4, n)), saved.settings)[0][0] for i in range(0, n, 4)]
        tiles, seconds = _written(parts, saved, folder)
        yield {
            "clouds": n, "s": seconds, "tiles": len(tiles),
            "sites": sum(t.sites + t.free_sites for t in tiles.values()),
            "sent": sum(_n_sites(a) for part in parts for a in part.values()),
            "bytes": sum(t.n_bytes for t in tiles.values()),
        }  # fmt: skip


def _written(parts: list[Any], saved: Saved, folder: Path) -> tuple[dict[int, Tile], float]:
    """The tiles of some parts, and the least seconds of three times that they were written."""
    stores = [new_store(folder, saved.settings) for _ in range(3)]
    runs = [timed(partial(WriteTiles(store, manifest_of(store, saved)), parts)) for store in stores]
    return min(runs, key=lambda run: run[1])


def _asks(saved: Saved, folder: Path) -> Iterator[dict[str, Any]]:
    """Points of some tiles, more and more of both."""
    store = new_store(folder, saved.settings)
    manifest = build(store, replace(saved, n=8), Threads(1))
    X, few = saved[4].points, sorted(manifest.tiles.items(), key=lambda t: -t[1].sites)
    AskTiles(store, replace(manifest, tiles={}))(Piece(X[:1000], None, dict(few[:1])))  # compiled code is loaded
    for n_tiles in (2, len(few)):
        tiles = dict(few[:n_tiles])
        for n in (1000, len(X) // 2, len(X)):
            work = AskTiles(store, replace(manifest, tiles={}))
            start = time.process_time()
            work(Piece(X[:: len(X) // n], None, tiles))
            spent = time.process_time() - start  # of all threads: a piece has one core on a cluster
            yield {"points": n, "sites": sum(t.sites + t.free_sites for t in tiles.values()), "s": spent}


def _by_classes(saved: Saved, folder: Path) -> Iterator[dict[str, Any]]:
    for n_classes in (11, 22, 44):
        some = replace(saved, n=4, n_classes=n_classes)
        parts, seconds, sites = min(
            (sums(some, range(4), some.settings) for _ in range(3)), key=lambda run: run[1]
        )
        tiles, more = _written(parts, some, folder)
        n_bytes = sum(t.n_bytes for t in tiles.values())
        yield {"classes": n_classes, "ms a cloud, summed": 250 * seconds, "ms a cloud, written": 250 * more,
               "bytes a site in its file": n_bytes / sites}  # fmt: skip


def _part_bytes(saved: Saved) -> float:
    parts, _, sites = sums(saved, range(4), saved.settings)
    return float(sum(a.nbytes for arrays in parts[0].values() for a in arrays.values()) / sites)


def _manifest_seconds(settings: Settings) -> float:
    """Seconds for a row of a manifest, written and read."""
    size = 1 << (settings.tiling.bits + 21)
    tiles = {key * size: Tile("0" * 64, 10**5, 10**4, 0) for key in range(4096)}
    manifest = Manifest(1, settings, "", tiles=tiles)
    return best(manifest.to_bytes, 3) / len(tiles)


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
        table("Classes: the same clouds, their labels spread over more classes.", list(_by_classes(saved, folder)))
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
