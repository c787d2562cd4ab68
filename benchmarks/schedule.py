"""A build on many machines, simulated: the steps of `semgp.store.build`, with costs that were measured.

Each version is two rounds of tasks. A task goes to the worker that is free first, in the order of submission: what
Ray and threads do. The one process that asks for the work submits tasks and looks after their results one by one;
parts go from worker to worker, and tiles to the store, at the given bandwidths. See `benchmarks/scaling.py`.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semgp.store.building import _CHUNK, BATCH

GIGABYTE = 1e9


@dataclass(frozen=True)
class Costs:
    """What was measured, in seconds, bytes and numbers.

    Parameters
    ----------
    cloud : sequence of float
        Seconds that single clouds took to be read and summed, drawn from for each cloud.
    site : float
        Seconds to add up, pack and write a site of a tile, per part that has it.
    tile : float
        Seconds for a tile, whatever it holds.
    part_bytes, tile_bytes : float
        Bytes a site on the way to its tile, and in its file.
    new_sites, new_tiles : float
        Sites and tiles that each cloud along the way adds to the map.
    first_sites, first_tiles : float
        Those of the first one.
    task, reference : float
        Seconds of the asking process for a task, and for each part of its result.
    manifest : float
        Seconds to write a tile's row in the manifest.
    """

    cloud: Sequence[float]
    site: float
    tile: float
    part_bytes: float
    tile_bytes: float
    new_sites: float
    new_tiles: float
    first_sites: float
    first_tiles: float
    task: float = 0.0
    reference: float = 0.0
    manifest: float = 0.0


@dataclass(frozen=True)
class Cluster:
    """Workers, and bandwidths in bytes a second: between two machines, and of the store for all of them."""

    workers: int
    cores_a_machine: int = 16
    network: float = 1.25 * GIGABYTE
    store: float = 5 * GIGABYTE


def finish(seconds: Sequence[float], workers: int, submit: float) -> float:
    """Return when the last of some tasks is done: each goes to the worker that is free first."""
    free = [0.0] * workers
    for i, cost in enumerate(seconds):
        heapq.heappush(free, max(heapq.heappop(free), (i + 1) * submit) + cost)
    return max(free)


def version(costs: Costs, cluster: Cluster, clouds: int, tiles_before: float, rng: np.random.Generator) -> float:
    """Return the seconds of one version of so many clouds."""
    W = cluster.workers
    chunk = max(1, min(_CHUNK, clouds // (2 * W)))
    n_chunks, n_parts = -(-clouds // chunk), 2 * W
    drawn = rng.choice(np.asarray(costs.cloud), size=(n_chunks, chunk)).sum(axis=1)
    submit = costs.task + n_parts * costs.reference
    first = max(finish(drawn.tolist(), W, submit), n_chunks * submit)
    sent = n_chunks * (costs.first_sites + (chunk - 1) * costs.new_sites)  # chunks along the way overlap
    old = costs.first_sites if tiles_before else 0.0  # in tiles that are written again
    tiles = costs.first_tiles + clouds * costs.new_tiles
    sites = costs.first_sites + clouds * costs.new_sites
    machines = max(1, W // cluster.cores_a_machine)
    shuffle = 0.0 if machines == 1 else sent * costs.part_bytes / (machines * cluster.network)
    counts = rng.multinomial(round(tiles), np.full(n_parts, 1 / n_parts))  # tiles are dealt, not weighed
    each = (sent + old) * costs.site / tiles + costs.tile
    second = finish((counts * each).tolist(), W, costs.task)
    written = sites * costs.tile_bytes / cluster.store
    return first + shuffle + max(second, written) + (tiles_before + tiles) * costs.manifest


def build_seconds(costs: Costs, cluster: Cluster, clouds: int, batch: int = BATCH, seed: int = 0) -> float:
    """Return the seconds of a whole build."""
    rng, size, total, done = np.random.default_rng(seed), batch * cluster.workers, 0.0, 0
    while done < clouds:
        n = min(size, clouds - done)
        total += version(costs, cluster, n, done * costs.new_tiles, rng)
        done += n
    return total
