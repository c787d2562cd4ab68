"""Surfaces end where nobody has looked."""

import numpy as np
import pytest

from semgp.surfaces import lattice, surface
from tests.surfaces.fields import F64, AnalyticMap, ball, grid, solid
from tests.surfaces.meshes import needs_extra, quiet, same_faces

pytestmark = quiet


def wall(behind: float, known_behind: bool, wave: float = 0.0, thickness: float = 0.2) -> AnalyticMap:
    """A wall, its near side at x = 0, seen from negative x; log-odds behind it, with waves."""

    def log_odds(X: F64) -> F64:
        x = X[:, 0]
        inside = np.minimum(x, thickness - x) / 0.02
        there = np.where(x < thickness / 2, np.clip(inside, -3, 3), np.clip(inside, behind, 3))
        return np.asarray(there + wave * np.where(x > thickness, np.sin(12 * (x - thickness)), 0))

    X = grid(-0.7, 0.7)
    face = X[(X[:, 0] >= 0) & (X[:, 0] <= 0.06)]
    made = AnalyticMap(log_odds, face, X[(X[:, 0] <= -0.1) & (X[:, 0] > -0.5)])
    if not known_behind:
        made.known = lambda X: X[:, 0] < thickness - 0.03
    return made


@needs_extra
class TestWhatHasBeenSeen:
    @pytest.mark.parametrize("thickness", [0.1, 0.2])
    @pytest.mark.parametrize("known_behind", [False, True])
    @pytest.mark.parametrize(("behind", "wave"), [(0.0, 0.0), (0.0, 0.3), (0.0, -0.3), (-0.4, 0.0), (-3.0, 0.0)])
    @pytest.mark.parametrize("level", [0.3, 0.5, 0.8])
    def test_a_wall_seen_from_one_side_is_one_sheet(
        self, behind: float, wave: float, known_behind: bool, level: float, thickness: float
    ) -> None:
        mesh = surface(wall(behind, known_behind, wave, thickness), resolution=0.03, level=level)
        place = 0.02 * np.log(level / (1 - level))
        np.testing.assert_allclose(mesh.vertices[:, 0], place, atol=0.01)
        assert (mesh.normals[:, 0] < -0.99).all()
        assert mesh.area > 1.3**2

    def test_a_wall_seen_from_both_sides_is_two(self) -> None:
        semantic_map = wall(-3.0, True)
        X = semantic_map.free_positions
        semantic_map.free_positions = np.concatenate([X, X * (-1, 1, 1) + (0.2, 0, 0)])
        mesh = surface(semantic_map, resolution=0.05)
        far = mesh.vertices[:, 0] > 0.1
        np.testing.assert_allclose(mesh.vertices[far, 0], 0.2, atol=0.01)
        assert (mesh.normals[far, 0] > 0.99).all()
        assert np.mean(far) == pytest.approx(0.5, abs=0.05)

    def test_nothing_grows_far_from_where_rays_ended(self, monkeypatch: pytest.MonkeyPatch) -> None:
        semantic_map = wall(0.0, True)
        X = semantic_map.occupied_positions
        semantic_map.occupied_positions = X[X[:, 1] < -0.2]
        meshes = []
        for cells in (1, 8):
            monkeypatch.setattr(lattice, "CELLS", cells)
            meshes.append(surface(semantic_map, resolution=0.05))
            assert meshes[-1].vertices[:, 1].max() == pytest.approx(-0.2 + 4 * 0.1, abs=0.1)
        assert same_faces(meshes[0]) == same_faces(meshes[1])

    def test_no_crossing_is_an_empty_mesh(self) -> None:
        semantic_map = solid(ball, 1.1)
        semantic_map.log_odds = lambda X: np.full(len(X), -1.0)
        mesh = surface(semantic_map, resolution=0.05)
        assert mesh.faces.shape == mesh.vertices.shape == mesh.normals.shape == mesh.colours.shape == (0, 3)
        assert mesh.area == 0
        assert surface(solid(ball, 1.1), resolution=0.05, low=(5, 5, 5)).faces.shape == (0, 3)
