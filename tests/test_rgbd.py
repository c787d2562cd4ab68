"""RGB-D folders: each layout against the numbers that it was written from."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semgp.camera import Pinhole, cloud_from_depth
from semgp.errors import FileFormatError, InputError
from semgp.readers import open_scans
from semgp.readers.recording import SkippedFramesWarning
from tests.rgbd_samples import (
    CLASSES,
    SHAPE,
    colour_image,
    depth_image,
    label_image,
    pose,
    save,
    write_open3d,
    write_scannet,
    write_seven_scenes,
    write_tum,
)

CAMERA = Pinhole(fx=20.0, fy=21.0, cx=7.5, cy=5.5)


def write_open3d_json(folder: Path) -> Path:
    return write_open3d(folder, as_json=True)


@pytest.mark.parametrize("write", [write_seven_scenes, write_open3d, write_open3d_json, write_tum])
def test_a_frame_is_its_depth_image_in_the_world(write: Callable[[Path], Path], tmp_path: Path) -> None:
    scans = open_scans(write(tmp_path), soft=False)
    assert len(scans) == 3
    for i, cloud in enumerate(scans):
        depth = np.where(np.isin(depth_image(i), (0, 65535)), np.nan, depth_image(i) / 1000)
        expected = cloud_from_depth(
            depth, CAMERA, CLASSES, label_image(i), colours=colour_image(i), T_world_sensor=pose(i)
        )
        assert len(cloud) == SHAPE[0] * SHAPE[1] - 3
        np.testing.assert_allclose(cloud.points, expected.points, atol=1e-6)
        assert cloud.T_world_sensor is not None
        np.testing.assert_allclose(cloud.T_world_sensor, pose(i), atol=1e-7)
        np.testing.assert_array_equal(cloud.colours, expected.colours)
        np.testing.assert_array_equal(cloud.pixels, expected.pixels)
        np.testing.assert_array_equal(cloud.hard_labels, expected.labels)
        assert cloud.image_shape == SHAPE
        assert cloud.classes == CLASSES


def test_scannet_points_find_their_pixels_in_larger_colour_images(tmp_path: Path) -> None:
    scans = open_scans(write_scannet(tmp_path), soft=False)
    cloud, (u, v) = scans[0], np.meshgrid(np.arange(SHAPE[1]), np.arange(SHAPE[0]))
    assert cloud.image_shape == (2 * SHAPE[0], 2 * SHAPE[1])
    assert cloud.pixels is not None
    # the larger camera sees pixel (u, v) at (2 u + 0.5, 2 v + 0.5), which rounds to the even neighbour
    rows, columns = np.round(2 * v + 0.5).astype(int).ravel()[3:], np.round(2 * u + 0.5).astype(int).ravel()[3:]
    assert (np.abs(cloud.pixels - np.column_stack([rows, columns])) <= 1).all()
    at = tuple(cloud.pixels.T)
    np.testing.assert_array_equal(cloud.colours, colour_image(0, cloud.image_shape)[at])
    np.testing.assert_array_equal(cloud.hard_labels, label_image(0, cloud.image_shape)[at])
    assert [scan.T_world_sensor[0, 3] for scan in scans if scan.T_world_sensor is not None] == [0, 1, 2]


def test_scannet_extrinsics_must_be_identities(tmp_path: Path) -> None:
    path = write_scannet(tmp_path)
    np.savetxt(path / "intrinsic/extrinsic_depth.txt", pose(1))
    with pytest.raises(FileFormatError, match=r"extrinsic_depth\.txt: is no identity"):
        open_scans(path)


def test_soft_labels_are_the_probabilities(tmp_path: Path) -> None:
    cloud = open_scans(write_seven_scenes(tmp_path))[0]
    assert cloud.weights is not None
    np.testing.assert_allclose(cloud.weights.sum(axis=1), 1, atol=3 / 255)


def test_without_labels_and_with_those_of_another_folder(tmp_path: Path) -> None:
    path = write_seven_scenes(tmp_path)
    (path / "labels").rename(tmp_path / "elsewhere")
    assert not open_scans(path)[0].labelled.any()
    assert open_scans(path, labels=tmp_path / "elsewhere")[0].classes == CLASSES
    with pytest.raises(InputError, match="no such folder of labels"):
        open_scans(path, labels="labels")


@pytest.mark.parametrize("number", ["nan", "-inf"])
@pytest.mark.parametrize("write", [write_seven_scenes, write_scannet])
def test_frames_without_a_pose_are_left_out_aloud(
    write: Callable[[Path], Path], number: str, tmp_path: Path
) -> None:
    path = write(tmp_path)
    files = sorted(path.rglob("*pose.txt")) or sorted((path / "pose").glob("*.txt"))
    np.savetxt(files[0], np.full((4, 4), float(number)))
    with pytest.warns(SkippedFramesWarning, match=r"1 of 3 frames have no valid pose and are left out"):
        scans = open_scans(path)
    assert len(scans) == len(list(scans)) == 2
    for file in files:
        np.savetxt(file, np.full((4, 4), float(number)))
    with pytest.raises(FileFormatError, match="3 frames, none of them with a valid pose"):
        open_scans(path)


def test_a_pose_that_is_finite_but_none_is_an_error(tmp_path: Path) -> None:
    path = write_seven_scenes(tmp_path)
    np.savetxt(path / "frame-000005.pose.txt", 2 * np.eye(4))
    with pytest.raises(FileFormatError, match=r"frame-000005\.pose\.txt: .* no rigid transform"):
        open_scans(path)


def test_options(tmp_path: Path) -> None:
    path = write_seven_scenes(tmp_path)
    whole = open_scans(path)[1]
    near = open_scans(path, max_depth=2.0)[1]
    assert len(near) == np.count_nonzero((depth_image(1) > 0) & (depth_image(1) <= 2000))
    coarse = open_scans(path, stride=3)[1]
    assert coarse.pixels is not None
    assert set(map(tuple, coarse.pixels.tolist())) == {(r, c) for r in range(1, 12, 3) for c in range(1, 16, 3)}
    doubled = open_scans(path, depth_scale=500.0, max_depth=100.0)[1]
    np.testing.assert_allclose((doubled.points - pose(1)[:3, 3])[-5:], 2 * (whole.points - pose(1)[:3, 3])[-5:])
    other = open_scans(path, camera=Pinhole(40.0, 42.0, 7.5, 5.5))[1]
    assert np.ptp(other.points, axis=0).sum() < np.ptp(whole.points, axis=0).sum()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stride": 0}, "stride must be a whole number"),
        ({"stride": 1.5}, "stride must be a whole number"),
        ({"max_depth": -1.0}, "max_depth must be a positive"),
        ({"max_depth": float("nan")}, "max_depth must be a positive"),
        ({"depth_scale": 0.0}, "depth_scale must be a positive"),
    ],
)
def test_options_out_of_range(options: dict[str, float], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        open_scans(write_seven_scenes(tmp_path), **options)


def test_large_images_are_thinned(tmp_path: Path) -> None:
    path = write_seven_scenes(tmp_path)
    for file, image in (
        ("color", np.zeros((480, 640, 3), np.uint8)),
        ("depth", np.full((480, 640), 900, np.uint16)),
    ):
        save(path / f"frame-000000.{file}.png", image)
    (path / "labels").rename(tmp_path / "elsewhere")
    assert len(open_scans(path)[0]) == 240 * 320


def test_images_that_do_not_fit_each_other(tmp_path: Path) -> None:
    path = write_seven_scenes(tmp_path)
    save(path / "frame-000000.color.png", np.zeros((5, 7, 3), np.uint8))
    with pytest.raises(FileFormatError, match="register colour to depth"):
        open_scans(path)[0]


def test_seven_scenes_states_its_intrinsics(tmp_path: Path) -> None:
    path = write_seven_scenes(tmp_path)
    with_file = open_scans(path)[0].points
    (path / "camera-intrinsics.txt").rename(tmp_path / "camera-intrinsics.txt")
    np.testing.assert_array_equal(open_scans(path)[0].points, with_file)
    (tmp_path / "camera-intrinsics.txt").unlink()
    expected = open_scans(path, camera=Pinhole(585, 585, 320, 240))[0].points
    np.testing.assert_array_equal(open_scans(path)[0].points, expected)


def test_open3d_counts_must_agree(tmp_path: Path) -> None:
    path = write_open3d(tmp_path)
    (path / "depth/00001.png").unlink()
    with pytest.raises(FileFormatError, match="3 colour images, 2 depth images and 3 poses"):
        open_scans(path)
    (path / "trajectory.log").unlink()
    with pytest.raises(FileFormatError, match="has no trajectory"):
        open_scans(path)


@pytest.mark.parametrize(
    "content", ["[" * 100_000, "3", "{}", '{"parameters": []}', '{"intrinsic_matrix": [1, 2]}']
)
def test_hostile_json(content: str, tmp_path: Path) -> None:
    path = write_open3d(tmp_path, as_json=True)
    (path / "trajectory.json").write_text(content)
    with pytest.raises(FileFormatError, match=r"trajectory\.json"):
        open_scans(path)
    (path / "trajectory.json").write_text(json.dumps({"parameters": [{"extrinsic": [1] * 15}]}))
    with pytest.raises(FileFormatError, match="PinholeCameraTrajectory"):
        open_scans(path)


class TestTUM:
    def test_stamps(self, tmp_path: Path) -> None:
        scans = open_scans(write_tum(tmp_path))
        stamps = [cloud.stamp for cloud in scans if cloud.stamp is not None]
        np.testing.assert_allclose(stamps, 1305031102 + np.arange(3) / 10)

    def test_frames_without_a_pose_or_depth_nearby(self, tmp_path: Path) -> None:
        path = write_tum(tmp_path)
        lines = (path / "groundtruth.txt").read_text().splitlines()
        (path / "groundtruth.txt").write_text("\n".join(lines[:8]))
        with pytest.warns(SkippedFramesWarning, match="1 of 3"):
            assert len(open_scans(path)) == 2
        lines = (path / "depth.txt").read_text().splitlines()
        (path / "depth.txt").write_text("\n".join(lines[:2]))
        assert len(open_scans(path)) == 1

    @pytest.mark.parametrize(
        ("name", "line", "message"),
        [
            ("rgb.txt", "1305031103 ../../secret.png", "outside its folder"),
            ("rgb.txt", "1305031103 /etc/secret.png", "outside its folder"),
            ("rgb.txt", "soon rgb/a.png", "stamps that are no numbers"),
            ("depth.txt", "1 depth/a.png", "do not ascend"),
            ("depth.txt", "1305031103", "lines of a stamp and a file"),
            ("groundtruth.txt", "1305031103 0 0 0 0 0 0 0", "quaternion of length 1"),
            ("groundtruth.txt", "1305031103 0 0 0 0 0 x 1", "line 14: could not convert"),
        ],
    )
    def test_bad_lines(self, name: str, line: str, message: str, tmp_path: Path) -> None:
        path = write_tum(tmp_path)
        with (path / name).open("a") as file:
            file.write(line + "\n")
        with pytest.raises(FileFormatError, match=message):
            open_scans(path)


def test_the_real_frames(data_dir: Path) -> None:
    scans = open_scans(data_dir / "sevenscenes")
    assert len(scans) == 30
    cloud = scans[29]
    assert 20_000 < len(cloud) <= 76_800
    assert cloud.image_shape == (480, 640)
    assert np.ptp(cloud.points, axis=0).max() < 10
