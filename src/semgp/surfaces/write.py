"""Write meshes as PLY files for viewers such as MeshLab, Blender and CloudCompare."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.surfaces.mesh import Mesh
from semgp.writers import atomic_write, coordinates, ply_header, structured


def write_mesh(path: str | Path, mesh: Mesh) -> None:
    """Write a mesh and what is known of its vertices as a binary little-endian PLY file.

    Vertices have x, y, z (float32, or float64 where that would lose `writers.LARGEST_ROUNDING`), nx, ny, nz, red,
    green, blue, label, probability, entropy and, where the mesh has it, variance. Comments
    `semgp class <label> <red> <green> <blue> <name>` name the classes: `semgp.read` takes the vertices for a
    cloud.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists.
    mesh : Mesh
        The mesh.

    Raises
    ------
    InputError
        A class name that a line of text cannot hold, or a folder that does not exist.
    """
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
