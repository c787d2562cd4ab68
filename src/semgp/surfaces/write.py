"""Write meshes: PLY for MeshLab, Blender and CloudCompare; GLB for browsers, see `surfaces.glb`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.surfaces.glb import write_glb
from semgp.surfaces.mesh import Mesh
from semgp.writers import atomic_write, coordinates, ply_header, structured

SUFFIXES = (".ply", ".glb")
"""Names of meshes end in one of these."""


def require_mesh_name(path: str | Path) -> str:
    """Return the suffix of a mesh's name.

    Raises
    ------
    InputError
        A name that ends in none of `SUFFIXES`.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: meshes are written as {' or '.join(SUFFIXES)}.")
    return suffix


def write_mesh(path: str | Path, mesh: Mesh) -> None:
    """Write a mesh and what is known of its vertices as a binary little-endian PLY file, or as `write_glb` does.

    In a PLY file, vertices have x, y, z (float32, or float64 where that would lose `writers.LARGEST_ROUNDING`),
    nx, ny, nz, red, green, blue, label, probability, entropy and, where the mesh has it, variance. Comments `semgp
    class <label> <red> <green> <blue> <name>` name the classes: `semgp.read` takes the vertices for a cloud.

    Parameters
    ----------
    path : str or Path
        A .ply or .glb file, replaced where it exists.
    mesh : Mesh
        The mesh.

    Raises
    ------
    InputError
        Another suffix, a class name that a line of text cannot hold, a folder that does not exist, or what
        `write_glb` cannot write.
    MissingExtraError
        A .glb file without the extra `mesh`.
    """
    if require_mesh_name(path) == ".glb":
        write_glb(path, mesh)
        return
    columns = coordinates(mesh.vertices)
    columns += [(f"n{axis}", values.astype("<f4")) for axis, values in zip("xyz", mesh.normals.T)]
    columns += zip(("red", "green", "blue"), mesh.colours.T)
    columns += [("label", mesh.label.astype("<i4")), ("probability", mesh.probability.astype("<f4"))]
    columns += [("entropy", mesh.entropy.astype("<f4"))]
    if mesh.variance is not None:
        columns += [("variance", mesh.variance.astype("<f4"))]
    n, faces = len(mesh.vertices), _face_rows(mesh)
    described = (f"element face {len(faces)}", "property list uchar int vertex_indices")
    header, rows = ply_header(columns, n, mesh.classes, *described), structured(columns, n)
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        file.write(header)
        rows.tofile(file)
        faces.tofile(file)


def _face_rows(mesh: Mesh) -> NDArray[np.void]:
    rows = np.empty(len(mesh.faces), dtype=[("n", "|u1"), ("vertices", "<i4", (3,))])
    rows["n"], rows["vertices"] = 3, mesh.faces
    return rows
