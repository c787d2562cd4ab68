"""What a map can do: where kinds of map differ in more than their answers."""

from __future__ import annotations

from semgp.blocks.model import BlockModel
from semgp.maps.gp import GPSemanticMap
from semgp.maps.protocol import SemanticMap, SpatialMap
from semgp.octomap import SemanticOctoMap
from semgp.store.tiled_map import TiledMap


def as_spatial(semantic_map: SemanticMap) -> SpatialMap | None:
    """Return a map that keeps free space as what it is, None for others."""
    if isinstance(semantic_map, SemanticOctoMap):
        return semantic_map
    if isinstance(semantic_map, GPSemanticMap | TiledMap) and semantic_map.free is not None:
        return semantic_map if isinstance(semantic_map, SpatialMap) else None
    return None


def resolution_of(semantic_map: SemanticMap) -> float | None:
    """Return the edge in metres of the voxels in which a map collects its data, None where there are none."""
    if isinstance(semantic_map, SemanticOctoMap):
        return semantic_map.resolution
    if isinstance(semantic_map, GPSemanticMap | TiledMap) and isinstance(semantic_map.model, BlockModel):
        return semantic_map.model.resolution
    return None
