"""Portraits of maps: where the camera stands, what covers a surface, keys, animations, sections, batches."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from semgp.baselines.knn import KNNMap
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError, MissingExtraError
from semgp.maps.batches import query_in_batches
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.picture import DARK, GREY, View, splat
from semgp.picture.animation import save_animation
from semgp.picture.camera import Camera, below
from semgp.picture.coverage import picture_resolution, spacing_of, surface_points
from semgp.picture.paint import Bar, paint, paint_labels
from semgp.picture.portrait import (
    Layer,
    cloud_layers,
    length_in_words,
    map_layers,
    metres_per_pixel,
    portrait,
    with_scale_bar,
)
from semgp.planning.section import section
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.surfaces import Mesh, write_mesh
from semgp.upward import direction
from tests.conftest import THREE

F64 = NDArray[np.float64]


def box(n: int = 4000, size: tuple[float, float, float] = (4, 2, 1)) -> F64:
    return np.random.default_rng(0).uniform(-0.5, 0.5, (n, 3)) * size + (10, 20, 5)


def on_screen(view: View, points: F64) -> F64:
    """Return columns and rows as shares of the frame, -1 to 1."""
    x, y, z = view.to_camera(points).T
    half = np.tan(np.radians(view.fov) / 2) * z
    return np.column_stack([x / (half * view.width / view.height), y / half])


class TestCamera:
    @pytest.mark.parametrize("up", [(0, 0, 1), (0, -1, 0), (1, 0, 0), (0.2, 0.3, 1)])
    @pytest.mark.parametrize("elevation", [-40.0, 0.0, 35.0, 90.0])
    def test_the_view_holds_the_cloud_and_fills_with_it(
        self, up: tuple[float, float, float], elevation: float
    ) -> None:
        points = box()
        view = Camera(elevation=elevation, up=up).view(points, 300, 200)
        place = abs(on_screen(view, points))
        assert (place < 1).all(axis=1).mean() > 0.995
        assert place.max() > 0.9
        upward = np.array(up) / np.linalg.norm(up)
        outward = view.eye - points.mean(axis=0)
        rise = np.degrees(np.arcsin(outward @ upward / np.linalg.norm(outward)))
        assert rise == pytest.approx(elevation, abs=6)

    def test_azimuth_is_the_side_of_the_eye(self) -> None:
        points = box()
        for azimuth, axis in ((0, (1, 0)), (90, (0, 1)), (180, (-1, 0)), (270, (0, -1))):
            view = Camera(azimuth, 10.0).view(points, 300, 200)
            level = (view.eye - points.mean(axis=0))[:2]
            assert level @ axis / np.linalg.norm(level) > 0.99

    def test_from_above_x_is_right_and_y_up(self) -> None:
        view = Camera(elevation=90.0).view(box(), 300, 200)
        middle, right, ahead = on_screen(view, np.array([(10, 20, 5.0), (11, 20, 5), (10, 21, 5)]))
        np.testing.assert_allclose((right - middle)[1], 0, atol=1e-6)
        assert right[0] > middle[0]
        assert ahead[1] < middle[1]

    def test_the_side_is_the_one_that_sees_most(self) -> None:
        """A floor with walls at its two far ends: the eye looks in between them."""
        step = np.arange(0, 4, 0.05)
        floor = np.array([(x, y, 0.0) for x in step for y in step])
        walls = np.array([p for x in step for z in step for p in ((x, 4.0, z), (4.0, x, z))])
        view = Camera().view(np.vstack([floor, walls]), 300, 200)
        assert (view.eye[:2] < 2).all()

    def test_zoom_narrows_the_view(self) -> None:
        points = box()
        near, far = (Camera(0.0, zoom=zoom).view(points, 300, 200) for zoom in (2.0, 1.0))
        np.testing.assert_allclose(near.eye, far.eye)
        np.testing.assert_allclose(on_screen(near, points), 2 * on_screen(far, points))

    def test_an_orbit_goes_round_at_one_distance_and_keeps_the_cloud_in_frame(self) -> None:
        points = box()
        views = list(Camera(30.0).orbit(points, 300, 200, 12))
        assert len(views) == 12
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        out = np.array([view.eye for view in views]) - middle
        np.testing.assert_allclose(np.linalg.norm(out, axis=1), np.linalg.norm(out[0]), rtol=1e-2)
        turned = np.diff(np.unwrap(np.arctan2(out[:, 1], out[:, 0])))
        np.testing.assert_allclose(turned, np.pi / 6, atol=0.02)
        for view in views:
            assert (abs(on_screen(view, points)) < 1).all(axis=1).mean() > 0.99

    def test_far_from_the_origin_the_view_is_the_same(self) -> None:
        points = box()
        a = Camera().view(points, 300, 200)
        b = Camera().view(points + 5e6, 300, 200)
        np.testing.assert_allclose(b.eye - 5e6, a.eye, atol=1e-6)

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"elevation": 91}, "elevation"),
            ({"azimuth": np.nan}, "azimuth"),
            ({"zoom": 0}, "zoom"),
            ({"up": (0, 0, 0)}, "upward"),
            ({"up": (0, 1)}, "upward"),
        ],
    )
    def test_settings_that_are_none(self, settings: dict[str, float], message: str) -> None:
        with pytest.raises(InputError, match=message):
            Camera(**settings)

    def test_clouds_that_are_none(self) -> None:
        for bad in (np.empty((0, 3)), np.ones((3, 2)), np.full((3, 3), np.nan)):
            with pytest.raises(InputError, match="points"):
                Camera().view(bad, 300, 200)
        with pytest.raises(InputError, match="two frames"):
            next(Camera().orbit(box(), 30, 20, 1))

    def test_directions_and_cuts(self) -> None:
        np.testing.assert_array_equal(direction("-y"), [0, -1, 0])
        points = box()
        np.testing.assert_array_equal(below(points, 5.2, direction("z")), points[points[:, 2] <= 5.2])
        np.testing.assert_array_equal(below(points, -20.0, direction("-y")), points[points[:, 1] >= 20])
        assert below(points, None, direction("z")) is not None
        with pytest.raises(InputError, match=r"from 4\.50 to 5\.50"):
            below(points, 1.0, direction("z"))


class TestCoverage:
    plane = np.array([(x, y, 1.0) for x in np.arange(0, 2, 0.1) for y in np.arange(0, 2, 0.1)])

    @pytest.mark.parametrize("resolution", [0.02, 0.03, 0.07])
    def test_finer_than_the_data_the_plane_is_filled(self, resolution: float) -> None:
        rng = np.random.default_rng(0)
        points = surface_points(self.plane + rng.normal(scale=0.001, size=self.plane.shape), resolution)
        np.testing.assert_allclose(points[:, 2], 1, atol=0.01)
        asked = np.random.default_rng(1).uniform(0.1, 1.8, (500, 2))
        gap = np.sqrt(((asked[:, None] - points[None, :, :2]) ** 2).sum(axis=2)).min(axis=1)
        assert gap.max() < 1.1 * resolution
        assert points[:, :2].min() > -0.25

    def test_coarser_than_the_data_each_voxel_has_its_mean(self) -> None:
        points = surface_points(self.plane + 0.05, 0.5)
        assert len(points) == 16
        np.testing.assert_allclose(points.mean(axis=0), self.plane.mean(axis=0) + 0.05)

    def test_the_usual_spacing(self) -> None:
        assert spacing_of(self.plane) == pytest.approx(0.1)
        assert spacing_of(self.plane[:1]) >= 0

    def test_few_points_stay(self) -> None:
        few = self.plane[:3]
        np.testing.assert_allclose(np.sort(surface_points(few, 0.01), axis=0), np.sort(few, axis=0))

    def test_the_resolution_follows_the_picture_and_the_data(self) -> None:
        fine, coarse = picture_resolution(self.plane, 2000), picture_resolution(self.plane, 200)
        assert 0 < fine < coarse == pytest.approx(1.5 * np.hypot(1.9, 1.9) / 200, rel=0.05)

    def test_bad_input(self) -> None:
        for resolution in (0.0, -1.0, np.nan):
            with pytest.raises(InputError, match="resolution"):
                surface_points(self.plane, resolution)
        with pytest.raises(InputError, match="empty"):
            surface_points(np.empty((0, 3)), 0.1)


def answer() -> Prediction:
    p = np.array([[0.8, 0.1, 0.1], [0.2, 0.5, 0.3], [1 / 3, 1 / 3, 1 / 3]])
    return Prediction(
        THREE, p, np.array([True, True, False]), variance=np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9.0]])
    )


class TestPaint:
    def test_classes_that_occur_are_the_key(self) -> None:
        shown = paint(answer(), "class")
        np.testing.assert_array_equal(shown.colours, [*THREE.palette[:2], GREY])
        assert shown.key == Classes(THREE.names[:2], THREE.colours[:2])
        assert shown.missing == "not observed"
        assert paint_labels("x", np.array([0]), THREE, "none").missing is None
        assert paint_labels("x", np.array([-1]), THREE, "none").key is None

    @pytest.mark.parametrize(
        ("by", "high"), [("confidence", 1.0), ("entropy", 1.1), ("variance", 5.0), ("wall", 1.0)]
    )
    def test_values_have_a_bar_and_are_grey_where_nothing_is_observed(self, by: str, high: float) -> None:
        shown = paint(answer(), by)
        assert isinstance(shown.key, Bar)
        assert shown.key.low == 0.0
        assert shown.key.high == pytest.approx(high, abs=0.05)
        assert (shown.colours[2] == GREY).all()
        assert (shown.colours[:2] != GREY).any(axis=1).all()

    def test_brighter_is_more(self) -> None:
        for by, more in (("confidence", 0), ("entropy", 1), ("variance", 1), ("floor", 0), ("wall", 1)):
            light = paint(answer(), by).colours[:2].astype(int) @ (0.299, 0.587, 0.114)
            assert light.argmax() == more

    def test_names_that_say_nothing(self) -> None:
        with pytest.raises(
            InputError, match="choose from class, confidence, entropy, variance, floor, wall, table"
        ):
            paint(answer(), "sofa")
        with pytest.raises(InputError, match="no variance"):
            paint(Prediction(THREE, answer().probability, answer().observed), "variance")


class TestPortrait:
    points = np.array([(x, y, 0.0) for x in np.linspace(-1, 1, 60) for y in np.linspace(-1, 1, 60)])
    view = Camera(elevation=90.0).view(points, 240, 160)

    def layers(self, *names: str) -> list[Layer]:
        p = np.zeros((len(self.points), 3))
        p[np.arange(len(p)), (self.points[:, 0] > 0).astype(int)] = 1
        return map_layers(self.points, 0.04, Prediction(THREE, p, np.ones(len(p), bool)), names)

    def test_a_single_layer_without_keys_is_the_splat(self) -> None:
        (layer,) = self.layers("class")
        page = portrait([layer], self.view, keys=False, scale_bar=False)
        np.testing.assert_array_equal(page, splat(self.points, layer.paint.colours, self.view, layer.size))

    def test_panels_titles_and_keys_add_up(self) -> None:
        one = portrait(self.layers("class"), self.view, keys=False)
        two = portrait(self.layers("class", "entropy"), self.view, keys=False)
        keyed = portrait(self.layers("class", "entropy"), self.view, title="A plane", background=DARK)
        assert one.shape == (160, 240, 3)
        assert two.shape[1] > 480
        assert keyed.shape[0] > two.shape[0] + 40
        assert keyed.shape[1] == two.shape[1]
        assert (keyed[0, 0] == DARK).all()
        for colour in THREE.colours[:2]:
            assert (keyed[two.shape[0] :] == colour).all(axis=2).sum() > 50

    def test_what_is_not_observed_is_left_out(self) -> None:
        seen = self.points[:, 1] > 0
        p = np.full((len(self.points), 3), 1 / 3)
        (layer,) = map_layers(self.points, 0.04, Prediction(THREE, p, seen), ["class"])
        np.testing.assert_array_equal(layer.points, self.points[seen])
        assert not map_layers(self.points, 0.04, Prediction(THREE, p, seen & False), ["class"])
        with pytest.raises(InputError, match="layer"):
            portrait([], self.view)

    def test_scans_beside_a_map(self, corner: LabelledCloud) -> None:
        up = direction("z")
        colours, labels = cloud_layers([corner, corner], ["class", "rgb"], 0.5, up)
        assert len(labels.points) == len(colours.points) == 2 * np.count_nonzero(corner.points[:, 2] <= 0.5)
        assert labels.paint.missing == "no label"
        assert (colours.paint.colours == 90).all()
        assert cloud_layers([], ["class"], None, up) == []
        with pytest.raises(InputError, match="--cloud"):
            cloud_layers([], ["rgb"], None, up)

    def test_the_scale_bar_measures_what_it_says(self) -> None:
        per_pixel = metres_per_pixel(self.points, self.view)
        left, right = (v[0] for v in on_screen(self.view, np.array([(-1, 0, 0.0), (1, 0, 0)])))
        assert 2 / ((right - left) / 2 * self.view.width) == pytest.approx(per_pixel, rel=1e-6)
        blank = np.full((300, 600, 3), 255, dtype=np.uint8)
        page = with_scale_bar(blank, 0.01)  # a fifth of the width is 1.2 m
        dark = np.flatnonzero((page[300 - 12] < 100).all(axis=1))
        assert np.ptp(dark) == pytest.approx(100, abs=3)  # 1 m

    def test_lengths_in_words(self) -> None:
        words = {0.005: "5 mm", 0.2: "20 cm", 1.0: "1 m", 50.0: "50 m", 2000.0: "2 km"}
        assert {metres: length_in_words(metres) for metres in words} == words


class TestAnimation:
    frames = np.random.default_rng(0).integers(0, 256, (5, 24, 32, 3), dtype=np.uint8)

    @pytest.mark.parametrize("suffix", [".gif", ".webp", ".png"])
    def test_it_opens_again_with_all_its_frames(self, suffix: str, tmp_path: Path) -> None:
        path = tmp_path / f"turn{suffix}"
        save_animation(path, iter(self.frames), rate=10)
        with Image.open(path) as moving:
            assert getattr(moving, "n_frames", 1) == 5
            assert moving.size == (32, 24)
            moving.seek(3)
            moving.load()
            assert moving.info["duration"] == 100
            if suffix == ".png":
                np.testing.assert_array_equal(np.asarray(moving.convert("RGB")), self.frames[3])
        assert [f.name for f in tmp_path.iterdir()] == [path.name]

    def test_bad_input_leaves_nothing(self, tmp_path: Path) -> None:
        bad: list[tuple[str, Callable[[], None]]] = [
            ("ends in", lambda: save_animation(tmp_path / "a.mp4", self.frames)),
            ("two pictures", lambda: save_animation(tmp_path / "a.gif", self.frames[:1])),
            ("one size", lambda: save_animation(tmp_path / "a.gif", [self.frames[0], self.frames[0, :9]])),
            ("rate", lambda: save_animation(tmp_path / "a.gif", self.frames, rate=0)),
            ("uint8", lambda: save_animation(tmp_path / "a.gif", self.frames.astype(float))),
        ]
        for message, save in bad:
            with pytest.raises(InputError, match=message):
                save()
        assert not list(tmp_path.iterdir())


def test_batches_answer_what_one_query_does(corner: LabelledCloud, monkeypatch: pytest.MonkeyPatch) -> None:
    gp_map = GPSemanticMap(corner.classes, free=FreeSpace())
    gp_map.update(corner)
    X, seen = np.random.default_rng(0).uniform(0, 2, (100, 3)), []
    whole = gp_map.query(X)
    monkeypatch.setattr("semgp.maps.batches.BATCH", 30)
    parts = query_in_batches(gp_map, X, lambda n, total: seen.append((n, total)))
    assert seen == [(30, 100), (60, 100), (90, 100), (100, 100)]
    np.testing.assert_allclose(parts.probability, whole.probability, atol=1e-5)
    np.testing.assert_array_equal(parts.observed, whole.observed)
    assert isinstance(parts.occupancy, OccupancyPrediction)
    assert whole.occupancy is not None
    np.testing.assert_allclose(parts.occupancy.probability, whole.occupancy.probability, atol=1e-5)
    assert len(query_in_batches(gp_map, np.empty((0, 3)))) == 0


class TestSection:
    def test_it_says_what_the_map_says(self, corner: LabelledCloud) -> None:
        knn = KNNMap(corner.classes)
        knn.update(corner)
        cut = section(knn, 0.8, (0.0, 0.0), (2.0, 1.0), resolution=0.1)
        assert cut.label.shape == (10, 20)
        there = knn.query([[0.75, 0.55, 0.8]])
        assert cut.label[5, 7] == there.label[0]
        assert cut.entropy[5, 7] == pytest.approx(there.entropy[0])
        assert not cut.free.any()

    def test_free_space_is_told_from_what_is_there(self, corner: LabelledCloud) -> None:
        gp_map = GPSemanticMap(corner.classes, free=FreeSpace())
        gp_map.update(corner)
        cut = section(gp_map, 1.0, (-1.0, -1.0), (3.0, 2.5), resolution=0.1)
        assert cut.free.any()
        assert (cut.label[cut.free] == -1).all()
        assert np.isnan(cut.entropy).any()  # behind the wall
        assert (cut.label[cut.label >= 0] == 1).mean() > 0.5  # the wall
        page = cut.picture()
        assert page.shape[1] > 1400
        assert (page == THREE.colours[1]).all(axis=2).any()

    def test_bad_input(self, corner: LabelledCloud) -> None:
        knn = KNNMap(corner.classes)
        with pytest.raises(InputError, match="empty"):
            section(knn, 1.0)
        knn.update(corner)
        for arguments in ((np.nan,), (1.0, (0, 0), (-1, 1)), (1.0, (0, np.inf), (1, 1))):
            with pytest.raises(InputError):
                section(knn, *arguments)
        with pytest.raises(InputError, match="resolution"):
            section(knn, 1.0, resolution=0.0)
        with pytest.raises(InputError):
            section(knn, 1.0, resolution=1e-7)


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
