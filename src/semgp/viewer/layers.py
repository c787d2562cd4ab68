"""What a viewer shows beside the map: input clouds, voxels of an OctoMap, free space, surfaces."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.batches import query_in_batches
from semgp.maps.protocol import SemanticMap
from semgp.octomap import SemanticOctoMap
from semgp.picture.colour import by_class
from semgp.surfaces.mesh import Mesh
from semgp.viewer.state import ViewState
from semgp.viewer.surface import free_positions
from semgp.voxels import voxel_centres, voxel_keys, voxel_origin

FREE_COLOUR = (120, 190, 235)
MOST_CUBES = 60_000
"""An OctoMap of more occupied voxels is shown in larger ones."""


@dataclass(frozen=True, eq=False)
class Layer:
    """Coloured points or cubes.

    Parameters
    ----------
    name : str
        What to call it.
    points : (N, 3) array
        Positions or centres, metres, world frame.
    colours : (N, 3) uint8 array
        Their colours.
    edge : float
        Edge of the cubes in metres, or the size of the points.
    cubes : bool
        Whether they are cubes.
    labels : (N,) integer array, optional
        Their labels in the map's classes: they go off with their class.
    """

    name: str
    points: NDArray[np.float64]
    colours: NDArray[np.uint8]
    edge: float
    cubes: bool = False
    labels: NDArray[np.int32] | None = None

    def within(self, state: ViewState) -> Layer:
        """Return what the section, and classes that are off, leave of it."""
        keep = state.inside(self.points)
        if self.labels is not None:
            keep &= ~np.isin(self.labels, list(state.hidden))
        return replace(self, points=self.points[keep], colours=self.colours[keep], labels=None)


def cloud_layer(clouds: Iterable[LabelledCloud], edge: float, most: int) -> Layer:
    """Return input clouds in their own colours, or those of their labels; of many points, every so-manieth.

    Raises
    ------
    InputError
        No points.
    """
    points, colours, step = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.uint8)], 1
    for cloud in clouds:
        points.append(cloud.points[::step])
        own = by_class(cloud.hard_labels, cloud.classes) if cloud.colours is None else cloud.colours
        colours.append(own[::step])
        while sum(map(len, points)) > most:
            points, colours, step = [p[::2] for p in points], [c[::2] for c in colours], 2 * step
    if not sum(map(len, points)):
        raise InputError("the clouds have no points: there is nothing to show.")
    name = "input cloud" if step == 1 else f"input cloud, 1 point in {step}"
    return Layer(name, np.concatenate(points), np.concatenate(colours), edge)


def octomap_layer(octomap: SemanticMap, most: int = MOST_CUBES) -> Layer:
    """Return the occupied voxels of an OctoMap as cubes in the colours of their labels.

    Raises
    ------
    InputError
        Another kind of map, or one without occupied voxels.
    """
    if not isinstance(octomap, SemanticOctoMap):
        raise InputError(f"cubes need an OctoMap, not a map of kind {octomap.kind!r}: semgp build --kind octomap.")
    centres, edge = octomap.occupied_positions, octomap.resolution
    if not len(centres):
        raise InputError("the OctoMap has no occupied voxel: there is nothing to show.")
    while len(centres) > most:
        edge *= 2
        origin = voxel_origin(centres, edge)
        centres = voxel_centres(np.unique(voxel_keys(octomap.occupied_positions, edge, origin)), edge, origin)
    label = _labels_near(octomap, centres, edge)
    return Layer(f"OctoMap, {edge:g} m", centres, by_class(label, octomap.classes), edge, True, label)


def _labels_near(octomap: SemanticOctoMap, centres: NDArray[np.float64], edge: float) -> NDArray[np.int32]:
    """Return the label of each voxel; of larger ones, that of the occupied voxel next to their middle."""
    if edge == octomap.resolution:
        return octomap.query(centres).label
    from scipy.spatial import cKDTree

    voxels = octomap.occupied_positions
    return octomap.query(voxels[cKDTree(voxels).query(centres)[1]]).label


def free_layer(semantic_map: SemanticMap, edge: float, most: int) -> Layer | None:
    """Return at most so many places where nothing is, darker where that is less sure; None from maps without."""
    free = free_positions(semantic_map)
    if free is None:
        return None
    free = free[:: max(1, -(-len(free) // most))]
    occupancy = query_in_batches(semantic_map, free).occupancy
    assert occupancy is not None
    sure = 1 - occupancy.probability[:, None]
    colours = np.rint(np.array(FREE_COLOUR) * (0.35 + 0.65 * sure)).astype(np.uint8)
    return Layer("free space", free, colours, edge)


def cut_mesh(mesh: Mesh, state: ViewState) -> NDArray[np.int32]:
    """Return the faces (F, 3) of a mesh that the section, and classes that are off, leave whole."""
    kept = state.inside(mesh.vertices) & ~np.isin(mesh.label, list(state.hidden))
    return np.asarray(mesh.faces[kept[mesh.faces].all(axis=1)])
