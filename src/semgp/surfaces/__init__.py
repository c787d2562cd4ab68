"""Surfaces of a map as triangle meshes with labels and uncertainty; works on any `SpatialMap`."""

from semgp.surfaces.extract import surface
from semgp.surfaces.glb import write_glb
from semgp.surfaces.mesh import Mesh
from semgp.surfaces.write import write_mesh

__all__ = ["Mesh", "surface", "write_glb", "write_mesh"]
