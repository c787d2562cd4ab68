"""Meshes in PLY files."""

from pathlib import Path

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.readers.ply import read_ply
from semgp.surfaces import Mesh, write_mesh
from tests.surfaces.fields import TWO
from tests.surfaces.meshes import quiet, triangle

pytestmark = quiet


class TestFiles:
    @pytest.mark.parametrize("at", [(0, 0, 0), (5e6 + 0.123, 4e6, 100)])
    def test_what_is_written_is_read(self, tmp_path: Path, at: tuple[float, ...]) -> None:
        trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
        mesh = triangle(np.array(at, dtype=np.float64))
        write_mesh(tmp_path / "mesh.ply", mesh)
        read = trimesh.load(tmp_path / "mesh.ply", process=False)
        np.testing.assert_array_equal(read.vertices, mesh.vertices)
        np.testing.assert_array_equal(read.faces, mesh.faces)
        np.testing.assert_array_equal(read.visual.vertex_colors[:, :3], mesh.colours)
        np.testing.assert_array_equal(read.face_normals, [[0, 0, 1]])
        stored = read.metadata["_ply_raw"]["vertex"]["data"]
        for name in ("label", "probability", "entropy", "variance"):
            np.testing.assert_allclose(stored[name].ravel(), getattr(mesh, name), rtol=1e-6)
        np.testing.assert_array_equal(
            np.stack([stored["nx"], stored["ny"], stored["nz"]], -1).squeeze(), mesh.normals
        )
        assert read.area == pytest.approx(mesh.area) == 6

    def test_semgp_reads_the_vertices(self, tmp_path: Path) -> None:
        mesh = triangle(np.zeros(3))
        write_mesh(tmp_path / "mesh.ply", mesh)
        cloud = read_ply(tmp_path / "mesh.ply")
        assert cloud.classes == TWO
        np.testing.assert_array_equal(cloud.points, mesh.vertices)
        np.testing.assert_array_equal(cloud.hard_labels, mesh.label)
        assert cloud.colours is not None
        np.testing.assert_array_equal(cloud.colours, mesh.colours)

    def test_a_mesh_of_nothing_without_variance(self, tmp_path: Path) -> None:
        none, empty = np.empty((0, 3)), np.empty(0)
        mesh = Mesh(TWO, none, none.astype(np.int32), none, empty.astype(np.int32), empty, empty)
        write_mesh(tmp_path / "mesh.ply", mesh)
        header = (tmp_path / "mesh.ply").read_bytes()
        assert header.endswith(b"element face 0\nproperty list uchar int vertex_indices\nend_header\n")
        assert b"element vertex 0\n" in header
        assert b"variance" not in header

    def test_nothing_half_written(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="rename the class"):
            write_mesh(tmp_path / "mesh.ply", triangle(np.zeros(3), Classes(("a\nend_header", "b"))))
        with pytest.raises(InputError, match="does not exist"):
            write_mesh(tmp_path / "no" / "mesh.ply", triangle(np.zeros(3)))
        assert list(tmp_path.iterdir()) == []
