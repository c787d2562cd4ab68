"""Meshes in GLB files."""

import sys
from pathlib import Path

import numpy as np
import pytest

from semgp.errors import InputError, MissingExtraError
from semgp.surfaces import Mesh, write_mesh
from tests.conftest import THREE


class TestGLB:
    @staticmethod
    def mesh(offset: float = 0.0, n_faces: int = 2) -> Mesh:
        vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 2.0)]) + offset
        faces = np.array([(0, 1, 2), (0, 1, 3)], dtype=np.int32)[:n_faces]
        normals = np.tile([0.0, 0, 1], (4, 1))
        label, p = np.array([0, 1, 2, -1], dtype=np.int32), np.array([0.9, 0.8, 0.7, 0.6])
        return Mesh(THREE, vertices, faces, normals, label, p, 1 - p, 2 * p)

    @pytest.mark.parametrize("offset", [0.0, 5e6])
    def test_trimesh_opens_it_again(self, offset: float, tmp_path: Path) -> None:
        trimesh = pytest.importorskip("trimesh", reason="GLB needs the extra mesh")
        mesh = self.mesh(offset)
        write_mesh(tmp_path / "mesh.glb", mesh)
        scene = trimesh.load(tmp_path / "mesh.glb", process=False)
        (read,) = scene.geometry.values()
        T_gltf_mesh = scene.graph[scene.graph.nodes_geometry[0]][0]
        x, y, z = (read.vertices @ T_gltf_mesh[:3, :3].T + T_gltf_mesh[:3, 3]).T
        np.testing.assert_allclose(np.column_stack([x, -z, y]), mesh.vertices, atol=1e-6)  # y up to z up
        np.testing.assert_array_equal(read.faces, mesh.faces)
        wanted = {"_LABEL": mesh.label, "_PROBABILITY": mesh.probability, "_ENTROPY": mesh.entropy}
        for name, values in (wanted | {"_VARIANCE": mesh.variance}).items():
            np.testing.assert_allclose(read.vertex_attributes[name].ravel(), np.asarray(values), rtol=1e-6)
        assert scene.metadata["classes"] == list(THREE.names)
        light = read.visual.vertex_attributes["color"][:, :3] / 255
        back = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(255 * back, mesh.colours, atol=8)  # dark ones lose most by being linear

    def test_bad_input_leaves_nothing(self, tmp_path: Path) -> None:
        pytest.importorskip("trimesh", reason="GLB needs the extra mesh")
        with pytest.raises(InputError, match="no faces"):
            write_mesh(tmp_path / "mesh.glb", self.mesh(n_faces=0))
        with pytest.raises(InputError, match=r"\.ply or \.glb"):
            write_mesh(tmp_path / "mesh.fbx", self.mesh())
        assert not list(tmp_path.iterdir())

    def test_the_missing_extra_is_named(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "trimesh", None)
        with pytest.raises(MissingExtraError, match=r"semgp\[mesh\]"):
            write_mesh(tmp_path / "mesh.glb", self.mesh())
        assert not list(tmp_path.iterdir())
