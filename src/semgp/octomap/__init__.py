"""Semantic OctoMap: occupancy by ray casting, averaged labels and colour in each voxel."""

from semgp.octomap.cells import Cells, Occupancy
from semgp.octomap.semantic import SemanticOctoMap
from semgp.octomap.sensor import SensorModel

__all__ = ["Cells", "Occupancy", "SemanticOctoMap", "SensorModel"]
