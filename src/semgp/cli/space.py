"""`semgp fuse`, `surface` and `slice`: maps joined, their surfaces as meshes, and slices for planners."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from semgp.checks import rigid_transform
from semgp.cli.console import STDOUT, progress
from semgp.errors import FileFormatError, InputError
from semgp.maps.files import load_map, save_map
from semgp.maps.fusion import fuse as fuse_maps
from semgp.maps.gp import GPSemanticMap
from semgp.maps.protocol import SpatialMap
from semgp.octomap import SemanticOctoMap

Pair = Annotated[tuple[float, float], Parameter(negative="")]


def fuse(map_file: Path, other: Path, /, *, out: Path, transform: Path | None = None) -> None:
    """Join two maps that were built apart into one of all that both have seen.

    Example: semgp fuse robot-1.semgp robot-2.semgp --out both.semgp

    Parameters
    ----------
    map_file
        A GP map that "semgp build" wrote; its frame is that of the result.
    other
        Another one of the same classes and model.
    out
        The map file to write.
    transform
        A text file with the 4 x 4 matrix that takes the other map's frame to the first one's; left out, they share
        a frame.
    """
    a, b = (_gp_map(path) for path in (map_file, other))
    T_a_b = None if transform is None else _matrix(transform)
    joined = fuse_maps(a, b, T_a_b)
    save_map(joined, out)
    STDOUT.print(f"{out}: {len(joined):,} sites from {len(a):,} and {len(b):,}")


def surface(
    map_file: Path,
    /,
    *,
    out: Path,
    resolution: float,
    of: str = "occupied",
    level: float = 0.5,
    quiet: bool = False,
) -> None:
    """Write the surface of what is there as a mesh, with classes, probabilities and variance at its vertices.

    Example: semgp surface room.semgp --resolution 0.05 --out room-mesh.ply

    Parameters
    ----------
    map_file
        A map with free space: "semgp build --free-space", or an OctoMap.
    out
        The mesh to write, a .ply file.
    resolution
        Edge in metres of the cells of the mesh; any will do, the map is continuous.
    of
        "occupied", or the name of a class.
    level
        The probability at which the surface lies.
    quiet
        Show no progress.
    """
    from semgp.surfaces import surface as extract
    from semgp.surfaces import write_mesh

    if out.suffix != ".ply":
        raise InputError(f"{out}: meshes are written as .ply.")
    with progress(quiet) as bars:
        bar = bars.add_task("extracting the surface", total=None)
        mesh = extract(
            _spatial_map(map_file),
            of,
            resolution=resolution,
            level=level,
            progress=lambda n, total: bars.update(bar, completed=n, total=total),
        )
    write_mesh(out, mesh)
    STDOUT.print(f"{out}: {len(mesh.faces):,} faces, {mesh.area:,.1f} square metres")


def slice_(
    map_file: Path,
    /,
    *,
    out: Path,
    heights: Pair,
    low: Pair | None = None,
    high: Pair | None = None,
    resolution: float | None = None,
    costs: Path | None = None,
) -> None:
    """Write a horizontal slice as the .pgm and .yaml files of ROS' map_server.

    Example: semgp slice floor.semgp --heights 0.1 1.2 --resolution 0.05 --out floor.yaml

    Parameters
    ----------
    map_file
        A map with free space: "semgp build --free-space", or an OctoMap. Its z axis points up.
    out
        The .yaml file to write; the .pgm goes beside it.
    heights
        From and to, metres: what is there between them is an obstacle.
    low
        Corner of the slice, x and y in metres; left out, that of all that is mapped.
    high
        The corner across from it.
    resolution
        Edge of a cell in metres; left out, the map's.
    costs
        A JSON file of costs from 0 to 100 by class name: cells then hold the cost of what they hold.
    """
    from semgp.planning import occupancy_grid

    semantic_map = _spatial_map(map_file)
    mapped = np.concatenate([semantic_map.occupied_positions, semantic_map.free_positions])[:, :2]
    if not len(mapped):
        raise InputError(f"{map_file} holds no free space and nothing occupied: build it from scans with a pose.")
    grid = occupancy_grid(
        semantic_map,
        mapped.min(axis=0) if low is None else low,
        mapped.max(axis=0) if high is None else high,
        heights=heights,
        resolution=semantic_map.resolution if resolution is None else resolution,
        costs=None if costs is None else _costs(costs),
    )
    grid.write(out)
    rows, columns = grid.data.shape
    STDOUT.print(f"{out}: {columns} x {rows} cells, {np.mean(grid.data >= 0):.0%} of them known")


def _gp_map(path: Path) -> GPSemanticMap:
    semantic_map = load_map(path)
    if not isinstance(semantic_map, GPSemanticMap):
        raise InputError(f"{path} holds a {semantic_map.kind} map: only GP maps are joined.")
    return semantic_map


def _spatial_map(path: Path) -> SpatialMap:
    semantic_map = load_map(path)
    if isinstance(semantic_map, SemanticOctoMap) or (
        isinstance(semantic_map, GPSemanticMap) and semantic_map.free is not None
    ):
        return semantic_map
    raise InputError(f"{path} keeps no free space: build it with semgp build --free-space.")


def _matrix(path: Path) -> np.ndarray:
    try:
        return rigid_transform(str(path), np.loadtxt(path))
    except OSError as error:
        raise FileFormatError(path, f"cannot be read: {error.strerror or error}.") from error
    except ValueError as error:
        raise FileFormatError(path, f"is no 4 x 4 matrix in text: {error}") from error


def _costs(path: Path) -> dict[str, int]:
    try:
        costs = json.loads(path.read_text())
        return {str(name): int(cost) for name, cost in costs.items()}
    except OSError as error:
        raise FileFormatError(path, f"cannot be read: {error.strerror or error}.") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise FileFormatError(path, f"holds no costs by class name as JSON: {error}") from error
