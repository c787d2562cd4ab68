"""What robot planners ask of a map: what a ray meets, what a view would tell, where the unknown begins, 2-D grids.

All of it works on any `SpatialMap`: a Gaussian-process map with free space, or an OctoMap.
"""

from semgp.planning.exploration import Frontiers, frontiers
from semgp.planning.layers import OccupancyGrid, occupancy_grid
from semgp.planning.rays import RayHits, raycast
from semgp.planning.views import InformationGain, information_gain

__all__ = [
    "Frontiers",
    "InformationGain",
    "OccupancyGrid",
    "RayHits",
    "frontiers",
    "information_gain",
    "occupancy_grid",
    "raycast",
]
