"""`semgp export`: a map as points, as an OctoMap or as a bag of ROS, for the tools of others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from semgp.cli.console import progress, report
from semgp.cli.places import require_place
from semgp.cli.space import spatial_map
from semgp.errors import InputError

if TYPE_CHECKING:
    from semgp.maps.protocol import SemanticMap

OCTOMAP_SUFFIXES = (".bt", ".ot")
BAG_SUFFIXES = (".mcap", ".db3", ".bag")
GRID_SUFFIX = ".zarr"


def export(map_file: Path, /, *, out: Path, resolution: float | None = None) -> None:
    """Write a map for other tools: as points along its surface, an OctoMap, a dense grid, or a bag of ROS.

    Example: semgp export room.semgp --out room.laz

    Example: semgp export drive.semgp --out map.mcap

    Parameters
    ----------
    map_file
        A map that `semgp build` wrote.
    out
        The file to write. Points: .ply, .pcd, .las, .laz, .csv or .npz, as `semgp query` writes them. OctoMap:
        .bt, free or occupied, or .ot, with log-odds and the class colours; for a map with free space (semgp build
        --free-space) or an OctoMap. Bags: .mcap or .db3 for ROS 2, .bag for ROS 1, with /semantic_map
        (PointCloud2) and, from maps with free space, /octomap (octomap_msgs). Grids: .zarr, a folder of dense
        arrays of labels, probabilities, variance and, where there is, occupancy.
    resolution
        Spacing of the points, or edge of the voxels, in metres; left out, the map's own.
    """
    require_place(map_file)

    from semgp.maps.points import POINT_WRITERS

    suffix = out.suffix.lower()
    formats = (*POINT_WRITERS, *OCTOMAP_SUFFIXES, *BAG_SUFFIXES, GRID_SUFFIX)
    if suffix not in formats:
        raise InputError(f"{out}: a map is written as {', '.join(formats)}.")
    if suffix == GRID_SUFFIX:
        _export_grid(map_file, out, resolution)
    elif suffix in BAG_SUFFIXES:
        _export_bag(map_file, out, resolution)
    elif suffix in OCTOMAP_SUFFIXES:
        _export_octomap(map_file, out, resolution)
    else:
        _export_points(map_file, out, resolution)


def _export_points(map_file: Path, out: Path, resolution: float | None) -> None:
    from semgp.maps.batches import query_in_batches
    from semgp.maps.files import load_map
    from semgp.maps.points import point_writer, write_prediction
    from semgp.maps.surface import surface_of

    point_writer(out)
    semantic_map = load_map(map_file)
    if resolution is None:
        resolution = _resolution(map_file, semantic_map)
    X = surface_of(semantic_map, resolution)
    with progress() as bars:
        asking = bars.add_task("asking the map", total=len(X))
        prediction = query_in_batches(semantic_map, X, lambda n, _: bars.update(asking, completed=n))
    write_prediction(out, X, prediction)
    report(f"{out}: {len(X):,} points, {resolution:g} m apart", out=out, points=len(X), resolution=resolution)


def _export_bag(map_file: Path, out: Path, resolution: float | None) -> None:
    from semgp.logs.maps import write_map
    from semgp.maps.abilities import as_spatial
    from semgp.maps.files import load_map
    from semgp.maps.octree import to_octomap
    from semgp.maps.surface import surface_of
    from semgp.octomap import SemanticOctoMap

    semantic_map = load_map(map_file)
    edge = _resolution(map_file, semantic_map) if resolution is None else resolution
    X = surface_of(semantic_map, edge)
    with progress() as bars:
        bars.add_task(f"querying {len(X):,} points", total=None)
        octomap = semantic_map if isinstance(semantic_map, SemanticOctoMap) else None
        spatial = as_spatial(semantic_map)
        if octomap is None and spatial is not None:
            octomap = to_octomap(spatial, resolution)
        write_map(out, semantic_map, X, octomap)
    words = f"{out}: {len(X):,} points, {edge:g} m apart" + ("" if octomap is None else ", and an OctoMap")
    report(words, out=out, points=len(X), resolution=edge, octomap=octomap is not None)


def _export_grid(map_file: Path, out: Path, resolution: float | None) -> None:
    from semgp.maps.files import load_map
    from semgp.maps.grid import write_grid

    semantic_map = load_map(map_file)
    edge = _resolution(map_file, semantic_map) if resolution is None else resolution
    with progress() as bars:
        bar = bars.add_task("asking the map, chunk by chunk", total=None)
        shape = write_grid(semantic_map, out, edge, lambda n, total: bars.update(bar, completed=n, total=total))
    report(f"{out}: {' x '.join(map(str, shape))} voxels of {edge:g} m", out=out, shape=shape, resolution=edge)


def _resolution(map_file: Path, semantic_map: SemanticMap) -> float:
    """Return the resolution of a map that has one."""
    from semgp.maps.abilities import resolution_of

    resolution = resolution_of(semantic_map)
    if resolution is None:
        raise InputError(f"{map_file} has no resolution of its own: give --resolution METRES.")
    return resolution


def _export_octomap(map_file: Path, out: Path, resolution: float | None) -> None:
    from semgp.maps.octree import to_octomap
    from semgp.octomap import SemanticOctoMap

    semantic_map = spatial_map(map_file)
    if isinstance(semantic_map, SemanticOctoMap):
        if resolution not in (None, semantic_map.resolution):
            raise InputError(
                f"{map_file} is an OctoMap of {semantic_map.resolution:g} m, and is written as it is."
            )
        octomap = semantic_map
    else:
        with progress() as bars:
            bars.add_task("asking for the voxels", total=None)
            octomap = to_octomap(semantic_map, resolution)
    octomap.write(out, "class" if out.suffix.lower() == ".ot" else None)
    occupied, free = len(octomap.occupied_positions), len(octomap.free_positions)
    text = f"{out}: {occupied:,} occupied and {free:,} free voxels"
    if octomap.origin.any():
        text += f", coordinates from {', '.join(f'{v:.12g}' for v in octomap.origin)} m"
    report(
        f"{text}, of {octomap.resolution:g} m",
        out=out,
        occupied=occupied,
        free=free,
        resolution=octomap.resolution,
    )
