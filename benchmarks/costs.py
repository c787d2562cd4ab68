"""What each step of a build or a query costs one core, measured alone and fitted.

Seconds are functions of clouds, points, sites, tiles and classes; `benchmarks/scaling.py` prints them, and
`benchmarks/schedule.py` puts them together to builds.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from saved_clouds import Saved, new_store
from schedule import Costs
from semgp.blocks.arrays import F64
from semgp.evaluation.measure import timed
from semgp.executors import Threads
from semgp.maps.tiles import Arrays
from semgp.store import Manifest, MapStore, Settings, Tile, build
from semgp.store.asking import AskTiles, Piece
from semgp.store.building import SumClouds, WriteTiles, _origin_of
from tables import best, table


def cost_model(saved: Saved, folder: Path) -> Costs:
    """Measure each step alone, print the fits, and return the costs."""
    _sums(saved, range(4), saved.settings)  # compiled code is loaded
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


def by_classes(saved: Saved, folder: Path) -> Iterator[dict[str, Any]]:
    """Costs of the same clouds, their labels spread over more classes."""
    for n_classes in (11, 22, 44):
        some = replace(saved, n=4, n_classes=n_classes)
        parts, seconds, sites = min(
            (_sums(some, range(4), some.settings) for _ in range(3)), key=lambda run: run[1]
        )
        tiles, more = _written(parts, some, folder)
        n_bytes = sum(t.n_bytes for t in tiles.values())
        yield {"classes": n_classes, "ms a cloud, summed": 250 * seconds, "ms a cloud, written": 250 * more,
               "bytes a site in its file": n_bytes / sites}  # fmt: skip


def _sums(saved: Saved, rows: range, settings: Settings) -> tuple[list[Any], float, int]:
    """Sum clouds; return the parts, seconds and sites."""
    origin = _origin_of(saved, range(1), settings)
    work = SumClouds(saved, settings, np.array(origin), 1)
    parts, seconds = timed(lambda: work(rows))
    return parts, seconds, sum(_n_sites(arrays) for arrays in parts[0].values())


def _n_sites(arrays: Arrays) -> int:
    return len(arrays["voxels"]) + len(arrays.get("free.voxels", ()))


def _manifest_of(store: MapStore, saved: Saved) -> Manifest:
    return replace(store.manifest(), origin=_origin_of(saved, range(1), saved.settings))


def _fit(rows: Sequence[dict[str, Any]], *names: str) -> F64:
    """Seconds as a sum of costs, none of them negative, of what the rows count."""
    A, b = (np.array([[r[name] for name in columns] for r in rows], dtype=float) for columns in (names, ["s"]))
    scale = A.max(axis=0)
    return np.asarray(nnls(A / scale, b[:, 0])[0] / scale)


def _clouds_of(saved: Saved, i: int) -> dict[str, float]:
    seconds, sites = min(_sums(saved, range(i, i + 1), saved.settings)[1:] for _ in range(3))
    return {"points": len(saved[i]), "s": seconds, "sites": sites}


def _writes(saved: Saved, folder: Path) -> Iterator[dict[str, Any]]:
    """Tiles of more and more clouds, summed four at a time."""
    for n in (1, 4, 8, len(saved)):
        parts = [_sums(saved, range(i, min(i + 4, n)), saved.settings)[0][0] for i in range(0, n, 4)]
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
    runs = [timed(partial(WriteTiles(store, _manifest_of(store, saved)), parts)) for store in stores]
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


def _part_bytes(saved: Saved) -> float:
    parts, _, sites = _sums(saved, range(4), saved.settings)
    return float(sum(a.nbytes for arrays in parts[0].values() for a in arrays.values()) / sites)


def _manifest_seconds(settings: Settings) -> float:
    """Seconds for a row of a manifest, written and read."""
    size = 1 << (settings.tiling.bits + 21)
    tiles = {key * size: Tile("0" * 64, 10**5, 10**4, 0) for key in range(4096)}
    manifest = Manifest(1, settings, "", tiles=tiles)
    return best(manifest.to_bytes, 3) / len(tiles)
