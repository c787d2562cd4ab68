"""Closed surfaces: meshes of bodies, seen from all sides."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from semgp.surfaces import lattice, surface
from tests.surfaces.fields import CENTRE, RADIUS, AnalyticMap, ball, box, solid
from tests.surfaces.meshes import assert_watertight, in_order, needs_extra, quiet, same_faces, volume

pytestmark = quiet


@needs_extra
class TestClosedSurfaces:
    def test_sphere(self) -> None:
        mesh = surface(solid(ball, 1.1), resolution=0.05)
        distance = np.linalg.norm(mesh.vertices - CENTRE, axis=1)
        np.testing.assert_allclose(distance, RADIUS, atol=0.002)
        assert_watertight(mesh.faces)
        n_edges = len(mesh.faces) * 3 // 2
        assert len(mesh.vertices) - n_edges + len(mesh.faces) == 2
        assert mesh.area == pytest.approx(4 * np.pi * RADIUS**2, rel=0.01)
        assert volume(mesh) == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)
        outwards = (mesh.vertices - CENTRE) / distance[:, None]
        assert ((mesh.normals * outwards).sum(axis=1) > 0.98).all()

    def test_box(self) -> None:
        mesh = surface(solid(box, 0.9), resolution=0.03)
        assert_watertight(mesh.faces)
        np.testing.assert_allclose(box(mesh.vertices), 0, atol=0.015)
        flat = np.abs(np.sort(np.abs(mesh.normals), axis=1)[:, 2] - 1) < 1e-9
        np.testing.assert_allclose(box(mesh.vertices[flat]), 0, atol=1e-6)
        assert np.mean(flat) > 0.7
        a, b, c = 0.82, 0.66, 0.56
        assert volume(mesh) == pytest.approx(a * b * c, rel=0.02)
        assert mesh.area == pytest.approx(2 * (a * b + b * c + c * a), rel=0.05)  # edges are cut off

    def test_a_surface_through_nodes(self) -> None:
        mesh = surface(solid(lambda X: 0.425 - np.abs(X).max(axis=1), 0.9), resolution=0.05)
        assert_watertight(mesh.faces)
        assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)
        assert volume(mesh) == pytest.approx(0.85**3, rel=0.03)

    @pytest.mark.parametrize("level", [0.2, 0.9])
    def test_level(self, level: float) -> None:
        mesh = surface(solid(ball, 1.1), resolution=0.05, level=level)
        wanted = RADIUS - 0.05 * np.log(level / (1 - level))
        np.testing.assert_allclose(np.linalg.norm(mesh.vertices - CENTRE, axis=1), wanted, atol=0.002)

    def test_a_finer_lattice_is_closer(self) -> None:
        errors = [
            np.abs(ball(surface(solid(ball, 1.1, softness=0.2), resolution=h).vertices)).max()
            for h in (0.15, 0.075, 0.0375)
        ]
        assert errors[0] > 3 * errors[1] > 9 * errors[2]

    def test_probabilities_of_zero_and_one(self) -> None:
        mesh = surface(solid(ball, 1.1, softness=1e-5), resolution=0.05)
        assert_watertight(mesh.faces)
        assert np.abs(ball(mesh.vertices)).max() < 0.05

    def test_bricks_leave_no_trace(self, monkeypatch: pytest.MonkeyPatch) -> None:
        meshes = []
        for cells in (3, 8, 20):
            monkeypatch.setattr(lattice, "CELLS", cells)
            meshes.append(surface(solid(ball, 1.1), resolution=0.05))
        for mesh in meshes[1:]:
            assert same_faces(mesh) == same_faces(meshes[0])

    def test_one_call_on_one_grid_finds_the_same(self) -> None:
        from skimage.measure import marching_cubes

        mesh = surface(solid(ball, 1.1), resolution=0.05)
        index = np.stack(np.meshgrid(*[np.arange(-16, 17)] * 3, indexing="ij"), axis=-1)
        values = ball((index.reshape(-1, 3) + 0.5) * 0.05).reshape(33, 33, 33)
        found: Callable[..., Any] = marching_cubes
        vertices, faces, *_ = found(values, 0.0, method="lorensen")
        assert mesh.faces.shape == faces.shape
        np.testing.assert_allclose(in_order(mesh.vertices), in_order((vertices - 15.5) * 0.05), atol=1e-4)

    def test_far_from_the_origin(self) -> None:
        offset = np.array([5e6, 4e6, 128.0])
        near = solid(ball, 1.1)
        far = AnalyticMap(
            lambda X: near.log_odds(X - offset), near.occupied_positions + offset, near.free_positions + offset
        )
        a, b = surface(near, resolution=0.0625), surface(far, resolution=0.0625)
        assert_watertight(b.faces)
        np.testing.assert_allclose(in_order(b.vertices - offset), in_order(a.vertices), atol=1e-7)
        assert b.area == pytest.approx(a.area, rel=1e-7)

    def test_a_box_cuts_the_mesh(self) -> None:
        low, high = np.array([-0.2, -2, 0]), np.array([0.3, 2, 2])
        whole = surface(solid(ball, 1.1), resolution=0.05)
        part = surface(solid(ball, 1.1), resolution=0.05, low=low, high=high)
        assert (part.vertices >= low).all()
        assert (part.vertices <= high).all()
        assert same_faces(part) < same_faces(whole)
        inside = (np.minimum(whole.vertices - low, high - whole.vertices) > 0.05).all(axis=1)
        assert len(part.faces) >= np.count_nonzero(inside[whole.faces].all(axis=1)) > 100

    def test_batches_bound_the_memory(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("semgp.surfaces.field.BATCH", 2000)
        monkeypatch.setattr("semgp.surfaces.extract.BATCH", 2000)
        calls: list[tuple[int, int]] = []
        semantic_map = solid(ball, 1.1)
        mesh = surface(semantic_map, resolution=0.05, progress=lambda done, total: calls.append((done, total)))
        assert len(mesh.vertices) > 2000 >= semantic_map.largest_query
        assert [done for done, _ in calls] == sorted({done for done, _ in calls})
        assert len(calls) > 3
        assert calls[-1][0] == calls[-1][1]
