"""Write meshes as PLY files for viewers such as MeshLab, Blender and CloudCompare."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.surfaces.mesh import Mesh
from semgp.writers import LARGEST_ROUNDING, atomic_write

_TYPES = {"f4": "float", "f8": "double", "u1": "uchar", "i4": "int"}


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
    vertices, faces = _vertex_rows(mesh), _face_rows(mesh)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment written by semgp",
        *_class_comments(mesh.classes),
        f"element vertex {len(vertices)}",
        *(f"property {_TYPES[vertices[name].dtype.str[1:]]} {name}" for name in vertices.dtype.names or ()),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        file.write("\n".join(header).encode())
        vertices.tofile(file)
        faces.tofile(file)


def _vertex_rows(mesh: Mesh) -> NDArray[np.void]:
    rounding = np.abs(mesh.vertices.astype(np.float32) - mesh.vertices).max(initial=0)
    place = "<f8" if rounding > LARGEST_ROUNDING else "<f4"
    columns: list[tuple[str, str, NDArray[Any]]]
    columns = [(name, place, mesh.vertices[:, axis]) for axis, name in enumerate("xyz")]
    columns += [(f"n{name}", "<f4", mesh.normals[:, axis]) for axis, name in enumerate("xyz")]
    columns += [(name, "|u1", mesh.colours[:, band]) for band, name in enumerate(("red", "green", "blue"))]
    columns += [("label", "<i4", mesh.label), ("probability", "<f4", mesh.probability)]
    columns += [("entropy", "<f4", mesh.entropy)]
    if mesh.variance is not None:
        columns += [("variance", "<f4", mesh.variance)]
    rows = np.empty(len(mesh.vertices), dtype=[(name, dtype) for name, dtype, _ in columns])
    for name, _, values in columns:
        rows[name] = values
    return rows


def _face_rows(mesh: Mesh) -> NDArray[np.void]:
    rows = np.empty(len(mesh.faces), dtype=[("n", "|u1"), ("vertices", "<i4", (3,))])
    rows["n"], rows["vertices"] = 3, mesh.faces
    return rows


def _class_comments(classes: Classes) -> list[str]:
    for name in classes.names:
        if not name or name != name.strip() or "\n" in name or "\r" in name:
            raise InputError(f"a PLY header cannot hold the class name {name!r}: rename the class.")
    return [
        f"comment semgp class {label} {red} {green} {blue} {name}"
        for label, (name, (red, green, blue)) in enumerate(zip(classes.names, classes.colours))
    ]
