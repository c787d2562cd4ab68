"""Surfaces of real kinds of map."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from semgp.blocks.model import BlockModel
from semgp.classes import MISSING
from semgp.gp.stationary import Matern52
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.octomap.semantic import SemanticOctoMap
from semgp.surfaces import Mesh, surface
from tests.surfaces.corner import ROOM, scan_of_a_corner
from tests.surfaces.meshes import needs_extra, quiet

pytestmark = quiet


@needs_extra
class TestMaps:
    @pytest.mark.parametrize("resolution", [0.04, 0.1])
    def test_octomap(self, resolution: float) -> None:
        semantic_map = SemanticOctoMap(ROOM, 0.1)
        semantic_map.update(scan_of_a_corner())
        mesh = surface(semantic_map, resolution=resolution)
        self.check(mesh, 0.15)
        assert mesh.variance is None
        assert np.mean(mesh.label == MISSING) < 0.05

    def test_gaussian_process(self) -> None:
        model = BlockModel(
            kernel=Matern52(ell=(0.5,), sf=1.0), resolution=0.1, s_n=0.3, nugget=0.05, a=0.2, delta=0.005, v_0=0.05
        )
        semantic_map = GPSemanticMap(ROOM, model, free=FreeSpace())
        semantic_map.update(scan_of_a_corner())
        mesh = surface(semantic_map, resolution=0.06)
        self.check(mesh, 0.2)
        assert mesh.variance is not None
        assert (mesh.label != MISSING).all()

    def check(self, mesh: Mesh, tolerance: float) -> None:
        x, _, z = mesh.vertices.T
        to_planes = np.minimum(np.abs(z - 0.01), np.abs(x - 2.01))
        assert np.quantile(to_planes, 0.95) < tolerance
        scanned = scan_of_a_corner().points
        assert cKDTree(mesh.vertices).query(scanned)[0].max() < 1.5 * tolerance
        towards = np.array([0.3, 0.0, 1.2]) - mesh.vertices
        assert np.mean((towards * mesh.normals).sum(axis=1) > 0) > 0.95
        flat = (x < 1.6) & (np.abs(mesh.vertices[:, 1]) < 0.6) & (mesh.label != MISSING)
        assert np.mean(mesh.label[flat] == 0) > 0.95
