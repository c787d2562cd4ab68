"""The synthetic room: its cameras, sensor and labels against what they promise."""

import numpy as np
import pytest
from scipy import ndimage

from semgp.camera import NYU_CAMERA
from semgp.checks import rigid_transform
from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.scene import DepthCamera, LabelFaults, SyntheticRoom, SyntheticScan, synthetic_room
from semgp.scene.room import CLASSES, HEIGHT, LENGTH, WIDTH
from tests.scene.conftest import SMALL
from tests.scene.solids import inside


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
