"""The synthetic room: its ray casting against geometry, its sensor and labels against what they promise."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from semgp.camera import NYU_CAMERA
from semgp.checks import rigid_transform
from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.scene import DepthCamera, LabelFaults, SyntheticRoom, SyntheticScan, synthetic_room
from semgp.scene.raycast import BOX, CYLINDER, ELLIPSOID, Solids, cast
from semgp.scene.room import CLASSES, HEIGHT, LENGTH, WIDTH
from semgp.scene.shading import shade

Vector = tuple[float, float, float]

SMALL = DepthCamera(160, 120)


def one(shape: int, half: Vector, yaw: float = 0.0) -> Solids:
    """Return a single solid around the origin."""
    return Solids(np.array([shape]), np.zeros((1, 3)), np.array([half]), np.array([yaw]))


def inside(solids: Solids, s: int, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points lie inside a solid, by its definition."""
    c, n = np.cos(solids.yaw[s]), np.sin(solids.yaw[s])
    p = (points - solids.centre[s]) @ np.array([[c, -n, 0], [n, c, 0], [0, 0, 1]]) / solids.half[s]
    if solids.shape[s] == BOX:
        return np.asarray(np.abs(p).max(axis=1) < 1)
    if solids.shape[s] == ELLIPSOID:
        return np.asarray((p**2).sum(axis=1) < 1)
    return np.asarray((np.hypot(p[:, 0], p[:, 1]) < 1) & (np.abs(p[:, 2]) < 1))


@pytest.fixture(scope="module")
def room() -> SyntheticRoom:
    return synthetic_room(seed=3, camera=SMALL)


@pytest.fixture(scope="module")
def scan(room: SyntheticRoom) -> SyntheticScan:
    return room.scan(0)


@pytest.mark.parametrize(
    ("solids", "origin", "direction", "distance", "normal"),
    [
        (one(ELLIPSOID, (2, 2, 2)), (-5, 0, 0), (1, 0, 0), 3, (-1, 0, 0)),
        (one(ELLIPSOID, (2, 2, 2)), (-5, 1, 0), (1, 0, 0), 5 - 3**0.5, (-(3**0.5) / 2, 0.5, 0)),
        (one(ELLIPSOID, (1, 1, 3)), (0, 0, 9), (0, 0, -2), 3, (0, 0, 1)),
        (one(BOX, (1, 2, 3)), (-5, 0, 0), (1, 0, 0), 4, (-1, 0, 0)),
        (one(BOX, (1, 2, 3)), (0, 0, 10), (0, 0, -1), 7, (0, 0, 1)),
        (one(BOX, (1, 1, 1), np.pi / 4), (-5, 0.1, 0), (1, 0, 0), 5.1 - 2**0.5, (-(0.5**0.5), 0.5**0.5, 0)),
        (one(CYLINDER, (1, 1, 2)), (-5, 0.6, 1), (1, 0, 0), 4.2, (-0.8, 0.6, 0)),
        (one(CYLINDER, (1, 1, 2)), (0.5, 0, -6), (0, 0, 1), 4, (0, 0, -1)),
        (one(CYLINDER, (1, 1, 2)), (-3, 0, 5), (1, 0, -1), 3, (0, 0, 1)),
    ],
)
def test_distances_and_normals_are_those_of_geometry(
    solids: Solids, origin: Vector, direction: Vector, distance: float, normal: Vector
) -> None:
    hits = cast(solids, origin, np.array([direction], dtype=float))
    assert hits.solid[0] == 0
    np.testing.assert_allclose(hits.distance[0], distance, rtol=1e-12)
    np.testing.assert_allclose(hits.normal[0], normal, atol=1e-12)


@pytest.mark.parametrize("shape", [BOX, ELLIPSOID, CYLINDER])
@pytest.mark.parametrize(
    ("origin", "direction"), [((-5, 0, 2), (1, 0, 0)), ((-5, 0, 0), (-1, 0, 0)), ((3, 0, 9), (0, 0, -1))]
)
def test_rays_that_pass_by_or_lead_away_hit_nothing(shape: int, origin: Vector, direction: Vector) -> None:
    hits = cast(one(shape, (1, 1, 1)), origin, np.array([direction], dtype=float))
    assert hits.solid[0] == -1
    assert np.isinf(hits.distance[0])
    assert not hits.normal.any()


def test_first_hit_is_where_a_march_along_the_ray_first_enters_a_solid() -> None:
    rng = np.random.default_rng(0)
    n = 12
    solids = Solids(
        rng.integers(0, 3, n), rng.uniform(-2, 2, (n, 3)), rng.uniform(0.2, 0.8, (n, 3)), rng.uniform(0, 6, n)
    )
    origins = rng.normal(0, 1, (200, 3))
    origins *= 8 / np.linalg.norm(origins, axis=1)[:, None]
    directions = rng.uniform(-2, 2, (200, 3)) - origins
    hits = cast(solids, origins, directions)
    steps = np.linspace(0, 2, 4001)
    for o, d, t, s in zip(origins, directions, hits.distance, hits.solid):
        entered = np.array([inside(solids, i, o + steps[:, None] * d) for i in range(n)])
        if entered.any():
            first = entered.any(axis=0).argmax()
            assert steps[first - 1] <= t <= steps[first]
            assert entered[s, first]
        else:  # nothing, or a corner cut within one step
            assert np.isinf(t) or not inside(solids, s, (o + (t + 2e-3) * d)[None])[0]
    hit = hits.solid >= 0
    assert 50 < hit.sum() < 200
    np.testing.assert_allclose(np.linalg.norm(hits.normal[hit], axis=1), 1)
    assert ((hits.normal * directions).sum(axis=1)[hit] < 0).all()


def test_things_throw_shadows() -> None:
    shelf = Solids(np.array([BOX]), np.array([[0.4, -0.3, 1.5]]), np.array([[0.3, 0.3, 0.02]]), np.zeros(1))
    floor = np.array([[0.4, -0.3, 0.0], [1.4, -0.3, 0.0], [2.6, -0.3, 0.0]])  # below the lamp, and beside
    normals, paint = np.tile([0.0, 0, 1], (3, 1)), np.full((3, 3), 200, dtype=np.uint8)
    below, beside, far = shade(shelf, floor, normals, paint)[:, 0].astype(int)
    assert below < far - 15
    assert far < beside


def test_rays_must_fit_each_other() -> None:
    with pytest.raises(InputError, match="directions"):
        cast(one(BOX, (1, 1, 1)), (0, 0, 0), np.zeros(3))
    with pytest.raises(InputError, match="origins"):
        cast(one(BOX, (1, 1, 1)), np.zeros((2, 3)), np.ones((3, 3)))


def test_same_seed_gives_the_same_scan_and_another_seed_or_view_does_not(scan: SyntheticScan) -> None:
    again = synthetic_room(seed=3, camera=SMALL).scan(0)
    for name in ("points", "labels", "colours", "pixels"):
        np.testing.assert_array_equal(getattr(scan.observed, name), getattr(again.observed, name))
        np.testing.assert_array_equal(getattr(scan.truth, name), getattr(again.truth, name))
    for other in (synthetic_room(seed=4, camera=SMALL).scan(0), synthetic_room(seed=3, camera=SMALL).scan(1)):
        assert not np.array_equal(scan.rgb, other.rgb)
        assert not np.array_equal(scan.depth, other.depth)


@pytest.mark.parametrize("seed", range(4))
def test_cameras_stand_free_inside_the_room_and_see_all_classes_between_them(seed: int) -> None:
    room = synthetic_room(seed, views=8, camera=DepthCamera(64, 48))
    seen = np.zeros(len(CLASSES), dtype=bool)
    for view in range(room.views):
        T = rigid_transform("pose", room.pose(view))
        assert (np.abs(T[:3, 3]) < (LENGTH / 2, WIDTH / 2, HEIGHT)).all()
        assert T[2, 1] < -0.9  # y points down
        scan = room.scan(view)
        assert np.isfinite(scan.depth_true).all()
        assert scan.depth_true.min() > 0.3
        seen[scan.label] = True
    assert seen.all()
    assert not any(inside(room.solids, s, T[None, :3, 3])[0] for s in range(len(room.solids)))


def test_clouds_and_images_agree(scan: SyntheticScan) -> None:
    truth, observed = scan.truth, scan.observed
    assert truth.pixels is not None
    assert truth.colours is not None
    assert truth.T_world_sensor is not None
    assert truth.image_shape == scan.depth.shape == (120, 160)
    np.testing.assert_array_equal(truth.pixels, observed.pixels)
    row, column = truth.pixels.T
    assert len(truth) == np.count_nonzero(scan.depth)
    np.testing.assert_array_equal(truth.labels, scan.label[row, column])
    np.testing.assert_array_equal(truth.colours, scan.rgb[row, column])
    T = truth.T_world_sensor
    for cloud, depth in ((truth, scan.depth_true), (observed, scan.depth)):
        camera_frame = (cloud.points - T[:3, 3]) @ T[:3, :3]
        np.testing.assert_allclose(camera_frame[:, 2], depth[row, column])
        u = SMALL.pinhole.cx + SMALL.pinhole.fx * camera_frame[:, 0] / camera_frame[:, 2]
        np.testing.assert_allclose(u, column, atol=1e-9)


def test_floor_walls_and_ceiling_are_where_the_room_ends(scan: SyntheticScan) -> None:
    points, labels = scan.truth.points, scan.truth.labels
    assert labels is not None
    assert (np.abs(points) <= np.array([LENGTH / 2, WIDTH / 2, HEIGHT]) + 1e-9).all()
    assert points[labels == CLASSES.index("floor"), 2].max() < 0.02
    np.testing.assert_allclose(points[labels == CLASSES.index("ceiling"), 2], HEIGHT)
    to_wall = np.array([LENGTH / 2, WIDTH / 2]) - np.abs(points[labels == CLASSES.index("wall"), :2])
    assert to_wall.min(axis=1).max() < 0.02


def test_noise_grows_with_the_square_of_the_depth() -> None:
    depth = np.repeat([[0.5], [1.0], [2.0], [4.0], [8.0]], 20_000, axis=1)
    camera = DepthCamera(noise=2e-3, dropout=0, grazing=0)
    measured = camera.measure(depth, np.ones_like(depth), np.random.default_rng(0))
    np.testing.assert_allclose((measured - depth).std(axis=1), 2e-3 * depth[:, 0] ** 2, rtol=0.03)
    np.testing.assert_allclose((measured - depth).mean(axis=1), 0, atol=4e-3)


def test_depth_goes_missing_at_random_and_at_grazing_angles() -> None:
    cosine = np.repeat([[1.0], [0.2], [0.1], [0.05], [0.0]], 20_000, axis=1)
    camera = DepthCamera(dropout=0.1, grazing=0.2)
    measured = camera.measure(np.full(cosine.shape, 2.0), cosine, np.random.default_rng(0))
    np.testing.assert_allclose((measured == 0).mean(axis=1), 1 - 0.9 * np.array([1, 1, 0.5, 0.25, 0]), atol=0.015)


def test_an_ideal_camera_measures_the_truth() -> None:
    scan = synthetic_room(camera=DepthCamera(64, 48, noise=0, grazing=0, dropout=0)).scan()
    np.testing.assert_array_equal(scan.depth, scan.depth_true)
    np.testing.assert_array_equal(scan.observed.points, scan.truth.points)


def test_labels_are_wrong_and_missing_in_the_promised_shares() -> None:
    label = np.random.default_rng(0).integers(0, 13, (120, 160), dtype=np.int32)
    given = LabelFaults(stride=1, wrong=0.1, missing=0).apply(label, 13, np.random.default_rng(1))
    assert (given != label).mean() == pytest.approx(0.1, abs=1e-4)
    assert given.min() >= 0
    assert given.max() < 13
    given = LabelFaults(stride=1, wrong=0, missing=0.25).apply(label, 13, np.random.default_rng(1))
    assert (given == MISSING).mean() == pytest.approx(0.25, abs=1e-4)
    np.testing.assert_array_equal(given[given != MISSING], label[given != MISSING])


def test_wrong_labels_come_in_blobs_of_one_wrong_class() -> None:
    label = np.zeros((120, 160), dtype=np.int32)
    given = LabelFaults(stride=1, wrong=0.1, missing=0).apply(label, 13, np.random.default_rng(2))
    blob, n = ndimage.label(given != label)
    assert np.count_nonzero(blob) / n > 30  # scattered errors would come in ones and twos
    assert all(len(np.unique(given[blob == i])) == 1 for i in range(1, n + 1))
    assert len(np.unique(given)) > 3


def test_labels_are_kept_on_a_grid_of_rows_and_columns_only() -> None:
    label = np.ones((120, 161), dtype=np.int32)
    given = LabelFaults(stride=4, wrong=0, missing=0).apply(label, 2, np.random.default_rng(0))
    rows, columns = np.nonzero(given != MISSING)
    assert len(rows) == 30 * 41
    assert not (rows % 4).any()
    assert not (columns % 4).any()


def test_some_objects_are_labelled_in_no_view() -> None:
    faults = LabelFaults(stride=1, wrong=0, missing=0, unlabelled=3)
    room = synthetic_room(seed=1, views=6, camera=SMALL, faults=faults)
    hidden_classes = set()
    for view in range(room.views):
        scan = room.scan(view)
        assert scan.observed.labels is not None
        assert scan.truth.labels is not None
        missing = scan.observed.labels == MISSING
        np.testing.assert_array_equal(scan.observed.labels[~missing], scan.truth.labels[~missing])
        hidden_classes |= set(scan.truth.labels[missing])
    assert 1 <= len(hidden_classes) <= 3
    everything = synthetic_room(seed=1, views=6, camera=SMALL, faults=LabelFaults(1, 0, 0, unlabelled=0)).scan()
    assert everything.observed.labelled.all()


def test_settings_out_of_range_are_refused(room: SyntheticRoom) -> None:
    for bad in ({"width": 0}, {"focal": 0.0}, {"noise": -1.0}, {"dropout": 1.0}, {"grazing": np.nan}):
        with pytest.raises(InputError):
            DepthCamera(**bad)
    for wrong in ({"stride": 0}, {"wrong": 1.1}, {"missing": -0.1}, {"blob": 0.0}, {"unlabelled": -1}):
        with pytest.raises(InputError):
            LabelFaults(**wrong)
    for view in (-1, room.views):
        with pytest.raises(InputError, match="view"):
            room.scan(view)
    with pytest.raises(InputError, match="seed"):
        synthetic_room(seed=-1)


def test_default_camera_sees_as_wide_as_that_of_nyu() -> None:
    ours = DepthCamera(640, 480).pinhole
    assert ours.fx == pytest.approx(NYU_CAMERA.fx, rel=0.01)
