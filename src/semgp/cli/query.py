"""`semgp query`: what a map says at points."""

from __future__ import annotations

from pathlib import Path

from semgp.cli.places import require_place
from semgp.cli.update import Address, Count, Workers
from semgp.errors import InputError


def query(
    map_file: Path,
    /,
    *,
    out: Path,
    points: Path | None = None,
    resolution: float | None = None,
    executor: Workers = "threads",
    workers: Count = None,
    address: Address = None,
) -> None:
    """Ask a map for class probabilities and uncertainty, and write them as points.

    Example: semgp query room.semgp --resolution 0.05 --out room-5cm.ply

    Parameters
    ----------
    map_file
        A map that `semgp build` wrote.
    out
        The file to write: .ply, .npz, .pcd, .las, .laz or .csv, with label, class colour, probabilities, entropy,
        variance and, from maps with free space, occupancy and state (1 occupied, 0 free, -1 unknown).
    points
        A point file: the query points.
    resolution
        Instead of points, the spacing in metres of points along the mapped surface; any will do.
    executor
        Who asks a store: the threads of this process, or a Ray cluster.
    workers
        How many at a time; one for each core by default.
    address
        Address of a Ray cluster, "auto" for the one this machine belongs to; left out, one is started here.
    """
    if (points is None) == (resolution is None):
        raise InputError("give either --points FILE or --resolution METRES.")
    require_place(map_file)

    import numpy as np

    from semgp.cli.console import progress, report
    from semgp.executors import open_executor
    from semgp.maps.batches import query_in_batches
    from semgp.maps.files import load_map
    from semgp.maps.points import point_writer, write_prediction
    from semgp.maps.surface import surface_of
    from semgp.readers import open_scans
    from semgp.store import StoredMap
    from semgp.store.asking import query as query_stored

    point_writer(out)
    semantic_map = load_map(map_file)
    many = executor != "threads" or workers is not None or address is not None
    if many and not isinstance(semantic_map, StoredMap):
        raise InputError("--executor, --workers and --address are for stores, and this map is one file.")
    if points is not None:
        X = np.concatenate([cloud.points for cloud in open_scans(points)])
    else:
        X = surface_of(semantic_map, resolution)
    with progress() as bars:
        asking = bars.add_task("asking the map", total=None if many else len(X))
        if many and isinstance(semantic_map, StoredMap):
            with open_executor(executor, workers, address) as work:
                prediction = query_stored(semantic_map.store, X, work, version=semantic_map.version)
        else:
            prediction = query_in_batches(semantic_map, X, lambda n, _: bars.update(asking, completed=n))
    write_prediction(out, X, prediction)
    seen = np.count_nonzero(prediction.observed)
    report(f"{out}: {len(X):,} points, {seen:,} of them observed", out=out, points=len(X), observed=seen)
