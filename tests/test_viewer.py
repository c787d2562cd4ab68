"""What a viewer shows, without a browser: points, fields, choices, layers, playback."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.errors import InputError, SemgpError
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.octomap import SemanticOctoMap
from semgp.picture.colour import by_class
from semgp.surfaces.mesh import Mesh
from semgp.viewer import cards
from semgp.viewer.fields import Scale, field_called, field_names, field_scale, field_values
from semgp.viewer.layers import cloud_layer, cut_mesh, free_layer, octomap_layer
from semgp.viewer.playback import Playback
from semgp.viewer.state import Sample, ViewState, lit, pick, show, take_sample
from semgp.viewer.surface import Surface
from semgp.viewer.worker import Latest, SupersededError

MODEL = replace(GENERAL, resolution=0.1)


@pytest.fixture(scope="module")
def plane() -> np.ndarray:
    """A floor of 2 m x 2 m, one datum every 10 cm."""
    x, y = np.meshgrid(np.arange(20) / 10 + 0.05, np.arange(20) / 10 + 0.05)
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(400)])


@pytest.fixture
def gp_map(corner: LabelledCloud) -> GPSemanticMap:
    made = GPSemanticMap(corner.classes, MODEL, free=FreeSpace())
    made.update(corner)
    return made


@pytest.fixture
def sample(gp_map: GPSemanticMap) -> Sample:
    return take_sample(gp_map, Surface.of(gp_map), 0.15, 100_000)


@pytest.mark.parametrize("shift", [0.0, 5e6])
def test_coarse_points_are_means_of_voxels(plane: np.ndarray, shift: float) -> None:
    points, resolution = Surface(plane + shift).points(0.4, 1000)
    assert resolution == 0.4
    near = {tuple(v) for v in np.floor((plane + 1e-9) / 0.4).astype(int)} if shift == 0 else None
    assert near is None or len(points) == len(near)
    np.testing.assert_allclose(points[:, 2] - shift, 0, atol=1e-8)
    np.testing.assert_allclose(points.mean(axis=0) - shift, [1, 1, 0], atol=0.11)


def test_fine_points_fill_the_plane_between_the_data(plane: np.ndarray) -> None:
    points, resolution = Surface(plane).points(0.025, 100_000)
    assert resolution == 0.025
    assert len(points) > 10 * len(plane)
    np.testing.assert_allclose(points[:, 2], 0, atol=1e-9)
    gaps = np.abs(points[:, None, :2] - plane[::7, :2] - (0.05, 0.05)).max(axis=2).min(axis=0)
    assert gaps.max() < 0.05


@settings(deadline=None, max_examples=40)
@given(st.floats(1e-3, 2.0), st.integers(1, 3000))
def test_never_more_points_than_there_is_room_for(resolution: float, most: int) -> None:
    rng = np.random.default_rng(0)
    points, kept = Surface(rng.uniform(0, 2, (300, 3))).points(resolution, most)
    assert 0 < len(points) <= most
    assert kept >= resolution


def test_normals_point_to_free_space(plane: np.ndarray) -> None:
    above = np.add(plane, (0, 0, 0.3))
    np.testing.assert_allclose(Surface(plane, above).normals(plane), np.tile([0, 0, 1.0], (400, 1)), atol=1e-9)
    np.testing.assert_allclose(Surface(plane, -above).normals(plane)[:, 2], -1, atol=1e-9)
    line = np.column_stack([np.arange(50) / 10, np.zeros(50), np.zeros(50)])
    assert not Surface(line).normals(line).any()
    assert not Surface(plane).oriented


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_handful_of_data(n: int) -> None:
    data = np.eye(3)[:n]
    points, _ = Surface(data).points(0.2, 1000)
    assert np.isfinite(points).all()
    assert np.isfinite(Surface(np.zeros((n, 3))).points(0.5, 10)[0]).all()


def test_a_surface_needs_data_and_a_resolution(plane: np.ndarray) -> None:
    with pytest.raises(InputError, match="map is empty"):
        Surface(np.empty((0, 3)))
    with pytest.raises(InputError, match="positive number of metres"):
        Surface(plane).points(0, 10)
    with pytest.raises(InputError, match="at least one point"):
        Surface(plane).points(1, 0)


def test_fields(sample: Sample) -> None:
    prediction = sample.prediction
    names = field_names(prediction)
    assert names[:5] == ("class", "confidence", "entropy", "variance", "occupancy")
    assert names[5:] == tuple(f"probability of {name}" for name in prediction.classes.names)
    assert field_called(prediction, "wall") == "probability of wall"
    seen = prediction.observed
    expected = np.where(seen, prediction.probability[:, 1], np.nan)
    np.testing.assert_array_equal(field_values(prediction, "wall"), expected)
    assert np.isnan(field_values(prediction, "entropy")[~seen]).all()
    for name in names[1:]:
        scale, values = field_scale(prediction, name), field_values(prediction, name)
        assert scale.low < scale.high
        assert np.nanmin(values) >= scale.low - 1e-9
        assert np.nanmax(values) <= scale.high + 1e-9
    with pytest.raises(InputError, match=r"no field 'colour'.*entropy.*wall"):
        field_called(prediction, "colour")


def test_show_hides_classes_and_cuts(sample: Sample) -> None:
    state = ViewState(0.15).switched(0, on=False)
    shown = show(sample, replace(state, low=(-np.inf, 0.5, -np.inf)))
    label = sample.prediction.label
    expected = [i for i in range(len(label)) if label[i] != 0 and sample.points[i, 1] >= 0.5]
    assert shown.rows.tolist() == expected
    np.testing.assert_array_equal(shown.colours, by_class(label[expected], sample.prediction.classes))
    assert state.switched(0, on=True) == ViewState(0.15)
    values = show(sample, replace(state, field="entropy"))
    assert values.scale == field_scale(sample.prediction, "entropy")
    assert len(np.unique(values.colours, axis=0)) > 10
    assert (lit(shown, (0, 0, 1)) <= shown.colours).all()
    assert not len(show(sample, replace(state, hidden=frozenset({MISSING, 0, 1, 2}))).rows)


def test_pick_takes_the_first_point_that_a_ray_meets(sample: Sample) -> None:
    shown = show(sample, ViewState(0.15))
    eye = np.array([1.0, -3.0, 4.0])
    rng = np.random.default_rng(1)
    for row in rng.choice(shown.rows, 20):
        found = pick(shown, eye, sample.points[row] - eye)
        assert found is not None
        reach = np.linalg.norm(sample.points[[row, found]] - eye, axis=1)
        assert reach[1] <= reach[0] + 0.31
    assert pick(shown, eye, (0, -1, 0)) is None
    assert pick(show(sample, ViewState(0.15, hidden=frozenset(range(-1, 3)))), eye, (0, 1, -1)) is None


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


def test_playback_goes_forth_and_back(corner: LabelledCloud) -> None:
    parts = [corner[i::3] for i in range(3)]
    playback = Playback(parts, lambda: GPSemanticMap(corner.classes, MODEL))
    playback.go_to(2)
    both = len(playback.semantic_map.positions)
    told: list[tuple[int, int]] = []
    playback.go_to(3, lambda n, total: told.append((n, total)))
    assert told == [(2, 3)]
    assert len(playback.semantic_map.positions) > both
    playback.go_to(2)
    assert len(playback.semantic_map.positions) == both
    with pytest.raises(InputError, match="1 to 3 scans, not 4"):
        playback.go_to(4)
    with pytest.raises(InputError, match="no scans"):
        Playback([], lambda: GPSemanticMap(corner.classes, MODEL))


def test_the_latest_request_wins() -> None:
    done: list[int] = []
    failures: list[str] = []
    begun, go = threading.Event(), threading.Event()

    def work(item: int) -> None:
        if item == 0:
            begun.set()
            go.wait(10)
            raise SupersededError
        if item == 3:
            raise InputError("three")
        done.append(item)
        begun.set()

    def failed(error: SemgpError) -> None:
        failures.append(str(error))
        begun.set()

    worker = Latest(work, failed)
    worker.start()
    for item in (0, 1, 2):
        worker.request(item)
        begun.wait(10)
    begun.clear()
    go.set()
    begun.wait(10)
    begun.clear()
    worker.request(3)
    begun.wait(10)
    worker.close()
    assert done == [2]
    assert failures == ["three"]


def test_cards(sample: Sample) -> None:
    pieces = cards.answer(sample, 0)
    probability = sample.prediction.probability[0]
    names = [sample.prediction.classes.names[c] for c in np.argsort(-probability)]
    assert [pieces.index(f'title="{name}"') for name in names] == sorted(
        pieces.index(f'title="{name}"') for name in names
    )
    assert f"x {sample.points[0, 0]:.2f}" in pieces
    assert f"{100 * probability.max():.1f} %" in pieces
    assert "variance" in pieces
    assert "occupancy" in pieces
    assert "2.5 &lt;b&gt;" in cards.colour_bar(Scale(0, 2.5), "<b>")
    assert cards.colour_bar(None, "") == ""
    assert "&lt;script&gt;" in cards.message("<script>")
