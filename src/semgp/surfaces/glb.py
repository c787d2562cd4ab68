"""Write meshes as GLB, binary glTF 2.0, for browsers, Blender, Unity and the like."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError, MissingExtraError
from semgp.surfaces.mesh import Mesh
from semgp.upward import level
from semgp.writers import atomic_write

_TO_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_DULL = {
    "name": "classes",
    "doubleSided": True,
    "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9},
}


def write_glb(path: str | Path, mesh: Mesh) -> None:
    """Write a mesh as a .glb file: glTF 2.0, metres.

    Vertices have normals, class colours (`COLOR_0`, linear as glTF asks for) and the attributes `_LABEL` (-1 where
    it is missing), `_PROBABILITY`, `_ENTROPY` and, where the mesh has it, `_VARIANCE`, all of them float32. The
    scene's `extras` name the classes in the order of the labels. Positions are written relative to the middle of
    the mesh, in single precision; the node's matrix puts them back into the world and turns its
    upward axis into glTF's, y.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists.
    mesh : Mesh
        The mesh.

    Raises
    ------
    InputError
        A mesh without faces, which glTF cannot hold, or a folder that does not exist.
    MissingExtraError
        The extra `mesh` is not installed.
    """
    trimesh = _trimesh()
    if not len(mesh.faces):
        raise InputError(
            "the mesh has no faces, and glTF cannot hold an empty one: choose another level or class."
        )
    attributes = {"_LABEL": mesh.label, "_PROBABILITY": mesh.probability, "_ENTROPY": mesh.entropy}
    if mesh.variance is not None:
        attributes["_VARIANCE"] = mesh.variance
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    shape = trimesh.Trimesh(
        mesh.vertices - middle,
        mesh.faces,
        vertex_normals=mesh.normals,
        vertex_colors=linear(mesh.colours),
        vertex_attributes={name: values.astype(np.float32) for name, values in attributes.items()},
        process=False,
    )
    R = _TO_Y_UP @ level(mesh.up)
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = R, R @ middle
    scene = trimesh.Scene(metadata={"classes": list(mesh.classes.names)})
    scene.add_geometry(shape, node_name="map", geom_name="map", transform=to_world)
    content = trimesh.exchange.gltf.export_glb(scene, include_normals=True, tree_postprocessor=_finish)
    with atomic_write(path) as temporary:
        temporary.write_bytes(content)


def _finish(tree: dict[str, Any]) -> None:
    """Give the mesh a dull surface seen from both sides: glTF's own is metal, which looks black."""
    tree["materials"] = [_DULL]
    for shape in tree["meshes"]:
        for primitive in shape["primitives"]:
            primitive["material"] = 0


def linear(colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return sRGB colours as linear light (IEC 61966-2-1)."""
    c = colours / 255
    light = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.rint(255 * light), dtype=np.uint8)


def _trimesh() -> Any:
    try:
        import trimesh
        import trimesh.exchange.gltf
    except ImportError as error:
        raise MissingExtraError("writing GLB files", "mesh") from error
    return trimesh
