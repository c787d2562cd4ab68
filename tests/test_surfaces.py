"""Surfaces: meshes of fields whose surface is known, what has not been seen, other maps, and files."""

import itertools
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from scipy.special import expit

from semgp.blocks.model import BlockModel
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError, MissingExtraError
from semgp.gp.stationary import Matern52
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.octomap.semantic import SemanticOctoMap
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.readers.ply import read_ply
from semgp.surfaces import Mesh, lattice, surface, write_mesh
from semgp.surfaces.contour import Sheet, contour
from semgp.surfaces.evidence import REACH
from semgp.voxels import VoxelTable, voxel_keys

F64 = NDArray[np.float64]

needs_extra = pytest.mark.skipif(
    find_spec("skimage") is None, reason="the extra mesh (scikit-image) is not installed"
)
pytestmark = pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning:skimage")

TWO = Classes(("low", "high"), ((200, 30, 30), (30, 30, 200)))


class AnalyticMap:
    """A map that knows its field: log-odds of occupancy at points, everywhere or where `known` says.

    The upper class lies above z = 0; for positive x there are no labels next to the surface.
    """

    kind = "analytic"
    classes = TWO
    resolution = 0.1

    def __init__(self, log_odds: Callable[[F64], F64], occupied: F64, free: F64) -> None:
        self.log_odds = log_odds
        self.occupied_positions, self.free_positions = occupied, free
        self.positions = occupied
        self.known: Callable[[F64], NDArray[np.bool_]] = lambda X: np.ones(len(X), dtype=bool)
        self.largest_query = 0

    def query(self, points: ArrayLike) -> Prediction:
        X = np.asarray(points)
        self.largest_query = max(self.largest_query, len(X))
        g = self.log_odds(X)
        p = expit(g)
        high = expit(X[:, 2] / 0.02)
        probability = np.stack([1 - high, high], axis=1)
        variance = np.stack([1 + X[:, 0] ** 2, 2 + X[:, 0] ** 2], axis=1)
        occupancy = OccupancyPrediction(p, self.known(X))
        observed = (X[:, 0] < 0) | (np.abs(g) > 0.02)
        return Prediction(TWO, probability, observed, variance=variance, occupancy=occupancy)

    def occupancy(self, points: ArrayLike) -> OccupancyPrediction:
        occupancy = self.query(points).occupancy
        assert occupancy is not None
        return occupancy

    def update(self, cloud: LabelledCloud) -> None: ...

    def __len__(self) -> int:
        return len(self.positions)

    def info(self) -> dict[str, Any]:
        return {}

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        return {}, {}

    @classmethod
    def from_arrays(cls, *_: Any) -> Self:
        raise NotImplementedError


def grid(low: float, high: float, spacing: float = 0.05) -> F64:
    axis = np.arange(low, high + spacing / 2, spacing)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


def solid(distance: Callable[[F64], F64], reach: float, softness: float = 0.05) -> AnalyticMap:
    """Return the map of a body, seen from all sides, of a signed distance, positive within."""
    X = grid(-reach, reach)
    d = distance(X)
    inside = (d > 0) & (d < 0.1)
    return AnalyticMap(lambda X: distance(X) / softness, X[inside], X[(d < -0.05) & (d > -0.4)])


RADIUS, CENTRE = 0.6, np.array([0.013, -0.021, 0.008])


def ball(X: NDArray[np.floating]) -> F64:
    return np.asarray(RADIUS - np.linalg.norm(X - CENTRE, axis=1))


def box(X: NDArray[np.floating]) -> F64:
    return np.asarray((np.array([0.41, 0.33, 0.28]) - np.abs(X)).min(axis=1))


def directed_edges(faces: NDArray[np.integer]) -> NDArray[np.int64]:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)


def assert_watertight(faces: NDArray[np.integer]) -> None:
    """Each edge belongs to two faces, which pass it in opposite directions."""
    edges = directed_edges(faces)
    there = np.unique(edges, axis=0)
    assert len(there) == len(edges)
    np.testing.assert_array_equal(there, np.unique(edges[:, ::-1], axis=0))


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] - mesh.vertices[0] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def in_order(points: F64) -> F64:
    return points[np.lexsort(np.round(points, 6).T)]


def same_faces(mesh: Mesh) -> set[frozenset[tuple[float, ...]]]:
    """Faces by where their corners are, whatever the numbers of the vertices."""
    corners = np.round(mesh.vertices, 6) + 0.0
    return {frozenset(tuple(corners[v].tolist()) for v in face) for face in mesh.faces}


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


@needs_extra
class TestSeams:
    @pytest.mark.parametrize("seed", range(4))
    def test_any_signs_and_ties_give_closed_surfaces(self, seed: int) -> None:
        on = np.random.default_rng(seed).random((13, 13, 13)) < 0.4
        dense = -np.ones((16, 16, 16), dtype=np.float32)
        dense[1:14, 1:14, 1:14] = np.where(on, 1, -1)
        sheet = contour(*in_bricks(dense, 4))
        assert_watertight(sheet.faces)
        assert len(np.unique(sheet.vertices, axis=0)) == len(sheet.vertices)

    @pytest.mark.parametrize("seed", range(3))
    def test_faces_at_unknown_nodes_are_dropped_and_no_others(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        dense = rng.normal(size=(16, 16, 16)).astype(np.float32)
        unknown = rng.random(dense.shape) < 0.02
        full = contour(*in_bricks(np.where(unknown, np.float32(-1), dense), 4))
        holed = contour(*in_bricks(np.where(unknown, np.float32(np.nan), dense), 4))
        low, high = np.floor(full.vertices).astype(int), np.ceil(full.vertices).astype(int)
        meets_unknown = unknown[*low.T] | unknown[*high.T]
        expected = full.only(np.logical_not(meets_unknown))
        assert 0 < len(holed.faces) < len(full.faces)
        assert corners_of(holed) == corners_of(expected)

    @pytest.mark.parametrize("cells", [1, 3, 8])
    def test_every_node_near_by_is_there_once(self, cells: int, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(lattice, "CELLS", cells)
        positions = np.random.default_rng(0).uniform(-0.5, 0.5, (12, 3)) * (1, 1, 0.3)
        found = lattice.lattice_near(positions, 0.07, 0.05, lattice.box_between((-9, -9, -0.3), None))
        nodes = np.round(found.nodes(slice(0, len(found))) / 0.07 - 0.5).astype(int)
        index = np.stack(np.meshgrid(*[np.arange(-16, 16)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        X = (index + 0.5) * 0.07
        away = np.abs(X[:, None] - positions).max(axis=2).min(axis=1)
        wanted = index[(away <= REACH * 0.07 + 0.07) & (X[:, 2] >= -0.3)]
        as_set = set(map(tuple, nodes.tolist()))
        assert len(as_set) == len(nodes)
        assert as_set >= set(map(tuple, wanted.tolist()))
        assert len(nodes) < len(wanted) * (1 + 2 * cells / 11) ** 3

    def test_the_inner_node_is_inside(self) -> None:
        dense = np.random.default_rng(0).normal(size=(8, 8, 8)).astype(np.float32)
        sheet = contour(*in_bricks(dense, 4))
        assert (dense[*sheet.inner.astype(int).T] > 0).all()
        assert (np.abs(sheet.inner - sheet.vertices).max(axis=1) < 1).all()


def in_bricks(dense: NDArray[np.float32], cells: int) -> tuple[lattice.Lattice, NDArray[np.float32]]:
    """Return an array as a lattice with nodes one metre apart, and its values."""
    n = len(dense) // cells
    starts = np.array(list(itertools.product(range(n), repeat=3)))
    bricks = VoxelTable()
    bricks.insert(voxel_keys(starts + 0.5, 1.0))
    values = [dense[x : x + cells, y : y + cells, z : z + cells] for x, y, z in starts * cells]
    return lattice.Lattice(1.0, cells, np.zeros(3, dtype=np.int64), bricks), np.array(values)


def corners_of(sheet: Sheet) -> set[bytes]:
    return {np.sort(sheet.edges[face]).tobytes() for face in sheet.faces}


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


@needs_extra
class TestWhatAMeshShows:
    def test_labels_and_uncertainty_are_the_maps(self) -> None:
        semantic_map = solid(ball, 1.1)
        mesh = surface(semantic_map, resolution=0.05)
        answer = semantic_map.query(mesh.vertices)
        at = np.flatnonzero(answer.observed)
        assert 0 < len(at) < len(mesh.vertices)
        np.testing.assert_array_equal(mesh.label[at], answer.label[at])
        np.testing.assert_array_equal(mesh.probability[at], answer.confidence[at])
        np.testing.assert_array_equal(mesh.entropy[at], answer.entropy[at])
        assert mesh.variance is not None
        np.testing.assert_array_equal(mesh.variance[at], 1 + mesh.label[at] + mesh.vertices[at, 0] ** 2)

    def test_where_labels_lack_it_asks_within(self) -> None:
        mesh = surface(solid(ball, 1.1), resolution=0.05)
        assert np.mean(mesh.label == MISSING) < 0.02
        away = (np.abs(mesh.vertices[:, 2]) > 0.05) & (mesh.label != MISSING)
        np.testing.assert_array_equal(mesh.label[away], mesh.vertices[away, 2] > 0)
        np.testing.assert_array_equal(mesh.colours[away], TWO.palette[mesh.label[away]])

    def test_a_class(self) -> None:
        high = surface(solid(ball, 1.1), "high", resolution=0.05)
        dome = high.vertices[:, 2] > 0.1
        np.testing.assert_allclose(ball(high.vertices[dome]), 0, atol=0.01)
        assert high.vertices[:, 2].min() > -0.01
        assert set(high.label[dome]) <= {1, MISSING}
        below = high.vertices[~dome]
        assert ball(below).max() < 0.35  # the border between the classes is left open further in
        low = surface(solid(ball, 1.1), "low", resolution=0.05)
        assert low.vertices[:, 2].max() < 0.01

    def test_vertices_without_any_label_are_grey(self) -> None:
        semantic_map = solid(ball, 1.1)
        answer = semantic_map.query

        def unlabelled(points: ArrayLike) -> Prediction:
            p = answer(points)
            return Prediction(TWO, p.probability, np.zeros(len(p), dtype=bool), occupancy=p.occupancy)

        semantic_map.query = unlabelled  # type: ignore[method-assign]
        mesh = surface(semantic_map, resolution=0.1)
        assert (mesh.label == MISSING).all()
        assert mesh.variance is None
        assert len(np.unique(mesh.colours)) == 1


ROOM = Classes(("floor", "wall"))


def scan_of_a_corner() -> LabelledCloud:
    """A floor at z = 0.01 and a wall at x = 2.01, seen from above the floor; every second label is missing."""
    a, b = np.meshgrid(np.arange(0.2, 2, 0.02), np.arange(-0.8, 0.8, 0.02), indexing="ij")
    floor = np.stack([a, b, np.full_like(a, 0.01)], axis=-1).reshape(-1, 3)
    height = 1.0 + b[0] * 1.2
    y, z = np.meshgrid(b[0], height, indexing="ij")
    upright = np.stack([np.full_like(y, 2.01), y, z], axis=-1).reshape(-1, 3)
    labels = np.repeat([0, 1], [len(floor), len(upright)])
    labels[::2] = MISSING
    T_world_sensor = np.eye(4)
    T_world_sensor[:3, 3] = 0.3, 0.0, 1.2
    return LabelledCloud(np.concatenate([floor, upright]), ROOM, labels, T_world_sensor=T_world_sensor)


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


class TestRefusals:
    @pytest.mark.parametrize("resolution", [0, -1.0, np.nan, np.inf])
    @needs_extra
    def test_resolution(self, resolution: float) -> None:
        with pytest.raises(InputError, match="resolution must be a number, positive"):
            surface(solid(ball, 1.1), resolution=resolution)

    @pytest.mark.parametrize("level", [0, 1, -0.1, np.nan])
    @needs_extra
    def test_level(self, level: float) -> None:
        with pytest.raises(InputError, match="probability between 0 and 1"):
            surface(solid(ball, 1.1), resolution=0.1, level=level)

    @needs_extra
    def test_an_unknown_class_lists_the_known(self) -> None:
        with pytest.raises(InputError, match=r"'roof'.*'occupied' or of a class of low, high"):
            surface(solid(ball, 1.1), "roof", resolution=0.1)

    @pytest.mark.parametrize(("low", "high"), [((1, 1, 1), (1, 2, 2)), ((0, 0), None), (None, (0, 0, np.nan))])
    @needs_extra
    def test_box(self, low: ArrayLike | None, high: ArrayLike | None) -> None:
        with pytest.raises(InputError, match="a box needs two corners"):
            surface(solid(ball, 1.1), resolution=0.1, low=low, high=high)

    @needs_extra
    def test_empty_maps(self) -> None:
        with pytest.raises(InputError, match="the map is empty"):
            surface(SemanticOctoMap(TWO, 0.1), resolution=0.1)

    @needs_extra
    def test_maps_without_free_space(self) -> None:
        cloud = scan_of_a_corner()
        unseen = SemanticOctoMap(ROOM, 0.1, rays=False)
        unseen.update(cloud)
        plain = GPSemanticMap(ROOM)
        plain.update(cloud)
        silent = solid(ball, 1.1)
        silent.query = lambda X: Prediction(TWO, np.full((len(X), 2), 0.5), np.ones(len(X), bool))  # type: ignore
        other: Any = object()
        cases = ((unseen, "occupied"), (plain, "occupied"), (silent, TWO.names[0]), (other, "occupied"))
        for semantic_map, what in cases:
            with pytest.raises(InputError, match=r"no free space.*free=FreeSpace\(\)"):
                surface(semantic_map, what, resolution=0.1)

    @needs_extra
    def test_a_grid_too_large_says_what_fits(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(lattice, "MOST_NODES", 100_000)
        for resolution in (1e-320, 1e-9, 0.01):
            with pytest.raises(InputError, match="more than 100,000 nodes") as refused:
                surface(solid(ball, 1.1), resolution=resolution)
        fitting = float(str(refused.value).split("resolution of ")[1].split(" m")[0])
        assert 0.03 < fitting < 0.2
        assert len(surface(solid(ball, 1.1), resolution=fitting).faces) > 0

    def test_without_the_extra(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "skimage.measure", None)
        with pytest.raises(MissingExtraError, match=r"semgp\[mesh\]"):
            surface(solid(ball, 1.1), resolution=0.1)

    def test_meshes_that_make_no_sense(self) -> None:
        good = triangle(np.zeros(3))
        for name, value in (
            ("normals", np.zeros((2, 3))),
            ("label", np.zeros(4, dtype=np.int32)),
            ("variance", np.zeros((3, 1))),
            ("faces", np.zeros((1, 4), dtype=np.int32)),
            ("faces", np.array([[0, 1, 3]], dtype=np.int32)),
        ):
            with pytest.raises(InputError, match=name):
                Mesh(**{**vars(good), name: value})


def triangle(at: F64, classes: Classes = TWO) -> Mesh:
    return Mesh(
        classes,
        vertices=at + np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]]),
        faces=np.array([[0, 1, 2]], dtype=np.int32),
        normals=np.array([[0.0, 0, 1]] * 3),
        label=np.array([0, 1, MISSING], dtype=np.int32),
        probability=np.array([0.9, 0.8, 0.5]),
        entropy=np.array([0.1, 0.2, 0.3]),
        variance=np.array([1.0, 2.0, 3.0]),
    )


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
