"""What is shown beside a map."""

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.gp import GPSemanticMap
from semgp.octomap import SemanticOctoMap
from semgp.surfaces.mesh import Mesh
from semgp.viewer.layers import cloud_layer, cut_mesh, free_layer, octomap_layer
from semgp.viewer.state import ViewState
from tests.viewer.conftest import MODEL


def test_layers(corner: LabelledCloud, gp_map: GPSemanticMap) -> None:
    state = ViewState(0.1, high=(1.0, np.inf, np.inf))
    cloud = cloud_layer([corner, corner], 0.02, 1000)
    assert len(cloud.points) == 720
    assert (cloud.within(state).points[:, 0] <= 1).all()
    thin = cloud_layer([corner, corner], 0.02, 200)
    assert 50 < len(thin.points) <= 200
    assert "1 point in 4" in thin.name
    octomap = SemanticOctoMap(corner.classes, 0.1)
    octomap.update(corner)
    cubes = octomap_layer(octomap)
    assert len(cubes.points) == len(octomap.occupied_positions)
    off = cubes.within(ViewState(0.1).switched(0, on=False))
    assert 0 < len(off.points) < len(cubes.points)
    few = octomap_layer(octomap, most=50)
    assert len(few.points) <= 50
    assert few.edge > cubes.edge
    free = free_layer(gp_map, 0.02, 100)
    assert free is not None
    assert 10 < len(free.points) <= 100
    assert free_layer(GPSemanticMap(corner.classes, MODEL), 0.02, 100) is None


def test_layers_refuse(corner: LabelledCloud, gp_map: GPSemanticMap) -> None:
    with pytest.raises(InputError, match="not a map of kind 'gp'"):
        octomap_layer(gp_map)
    with pytest.raises(InputError, match="no occupied voxel"):
        octomap_layer(SemanticOctoMap(corner.classes))
    with pytest.raises(InputError, match="no points"):
        cloud_layer([corner[:0]], 0.02, 10)


def test_a_mesh_is_cut_with_its_classes(corner: LabelledCloud) -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=float)
    mesh = Mesh(
        corner.classes,
        vertices,
        np.array([[0, 1, 2], [1, 3, 2]], dtype=np.int32),
        np.tile([0.0, 0, 1], (4, 1)),
        np.array([0, 0, 0, 1], dtype=np.int32),
        np.ones(4),
        np.zeros(4),
    )
    assert len(cut_mesh(mesh, ViewState(1))) == 2
    assert cut_mesh(mesh, ViewState(1).switched(1, on=False)).tolist() == [[0, 1, 2]]
    assert not len(cut_mesh(mesh, ViewState(1, low=(0.5, 0, 0))))
