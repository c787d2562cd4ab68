"""`semgp surface`: the surface of what is there, as a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from semgp.cli.console import progress, report
from semgp.cli.places import require_place
from semgp.errors import InputError

if TYPE_CHECKING:
    from semgp.maps.protocol import SpatialMap


def surface(
    map_file: Path,
    /,
    *,
    out: Path,
    resolution: float,
    of: str = "occupied",
    level: float = 0.5,
) -> None:
    """Write the surface of what is there as a mesh, with classes, probabilities and variance at its vertices.

    Example: semgp surface room.semgp --resolution 0.05 --out room-mesh.ply

    Example: semgp surface drive.semgp --of car --resolution 0.1 --out cars.glb

    Parameters
    ----------
    map_file
        A map with free space: "semgp build --free-space", or an OctoMap.
    out
        The mesh to write: .ply, or .glb for browsers and Blender.
    resolution
        Edge in metres of the cells of the mesh; any will do, the map is continuous.
    of
        "occupied", or the name of a class.
    level
        The probability at which the surface lies.
    """
    require_place(map_file)

    from semgp.surfaces import surface as extract
    from semgp.surfaces.write import require_mesh_name, write_mesh

    require_mesh_name(out)
    with progress() as bars:
        bar = bars.add_task("extracting the surface", total=None)
        mesh = extract(
            spatial_map(map_file),
            of,
            resolution=resolution,
            level=level,
            progress=lambda n, total: bars.update(bar, completed=n, total=total),
        )
    write_mesh(out, mesh)
    words = f"{out}: {len(mesh.faces):,} faces, {mesh.area:,.1f} square metres"
    report(words, out=out, vertices=len(mesh.vertices), faces=len(mesh.faces), area=mesh.area)


def spatial_map(path: Path) -> SpatialMap:
    """Return the map at a place, which keeps free space.

    Raises
    ------
    InputError
        A map that does not; FileFormatError where the file is none.
    """
    from semgp.maps.abilities import as_spatial
    from semgp.maps.files import load_map

    spatial = as_spatial(load_map(path))
    if spatial is None:
        raise InputError(f"{path} keeps no free space: build it with semgp build --free-space.")
    return spatial
