"""Cameras of a log, and whole bags of compressed and distorted images of a real frame."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from semgp.camera import NYU_CAMERA, Pinhole
from semgp.cloud import LabelledCloud
from semgp.distortion import DistortedCamera
from semgp.errors import FileFormatError, InputError
from semgp.lenses import BrownConrady, Equidistant
from semgp.logs.intrinsics import camera_of, is_raw
from semgp.logs.reader import open_log
from semgp.logs.scans import LogScans
from tests.log_encoders import compressed_depth, jpeg, png
from tests.log_samples import STORAGES, RawBag, message, pose, raw_bag

K = np.array([[NYU_CAMERA.fx, 0, NYU_CAMERA.cx], [0, NYU_CAMERA.fy, NYU_CAMERA.cy], [0, 0, 1]])
P = np.array([200.0, 0, 20, 0, 0, 210, 15, 0, 0, 0, 1, 0])
RECTIFIED = Pinhole(200.0, 210.0, 20.0, 15.0)
LENS = (0.1, -0.2, 0.001, -0.002, 0.03)


def camera_info(**changes: Any) -> Any:
    plain = {"k": K.ravel(), "p": P, "d": np.zeros(5), "distortion_model": "plumb_bob"}
    return message(**{**plain, "binning_x": 0, "binning_y": 0, "roi": message(width=0, height=0), **changes})


def test_rectified_images_are_of_p_and_raw_ones_of_k_and_d() -> None:
    for raw in (False, True):
        assert camera_of(camera_info(), raw=raw) == RECTIFIED
        assert camera_of(camera_info(d=np.zeros(0), distortion_model=""), raw=raw) == RECTIFIED
        assert camera_of(camera_info(p=np.zeros(12)), raw=raw) == NYU_CAMERA
    bent = camera_info(d=np.array(LENS))
    assert camera_of(bent, raw=False) == RECTIFIED
    assert camera_of(bent, raw=True) == DistortedCamera(NYU_CAMERA, BrownConrady(*LENS))
    one = message(**{name.upper() if name in "kpd" else name: value for name, value in vars(bent).items()})
    assert camera_of(one, raw=True) == camera_of(bent, raw=True)
    fish = camera_info(d=np.array(LENS[:4]), distortion_model="equidistant")
    assert camera_of(fish, raw=True) == DistortedCamera(NYU_CAMERA, Equidistant(*LENS[:4]))


def test_cameras_that_are_refused() -> None:
    with pytest.raises(InputError, match="binned or cut-out"):
        camera_of(camera_info(binning_x=2), raw=False)
    with pytest.raises(InputError, match="focal lengths"):
        camera_of(camera_info(k=np.zeros(9), p=np.zeros(12)), raw=False)
    unknown = camera_info(d=np.ones(5), distortion_model="thin_prism")
    assert camera_of(unknown, raw=False) == RECTIFIED
    with pytest.raises(InputError, match="'thin_prism', not one of plumb_bob"):
        camera_of(unknown, raw=True)


def test_names_of_raw_images() -> None:
    assert is_raw("/camera/depth/image_raw")
    assert is_raw("image_raw/compressed")
    assert is_raw("/camera/depth/image_raw/compressedDepth")
    assert not is_raw("/camera/depth/image_rect_raw")
    assert not is_raw("/camera/depth/image_rect/compressedDepth")
    assert not is_raw("/image_raw/other")


Frame = tuple[NDArray[np.uint16], NDArray[np.uint8], NDArray[np.uint8]]


@pytest.fixture(scope="module")
def frame(data_dir: Path) -> Frame:
    """Depth in mm, labels (255 missing) and colours of an NYU frame, every second pixel."""
    names = ("depth_mm.png", "label13.png", "rgb.jpg")
    depth, raw, colours = (np.array(Image.open(data_dir / "nyu" / f"0282_{name}"))[::2, ::2] for name in names)
    return depth.astype(np.uint16), raw.astype(np.uint8) - 1, colours.copy()


def open_images(path: Path, depth: str, labels: str, colour: str) -> LogScans:
    return open_log(path, depth=depth, labels=labels, colour=colour, camera_info="/camera_info", frame="map")


def require_same(found: LabelledCloud, expected: LabelledCloud) -> None:
    assert len(found) > 70_000
    for name in ("points", "labels", "colours", "pixels", "T_world_sensor"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def begin(bag: RawBag, frame: Frame, lens: tuple[str, tuple[float, ...]] = ("plumb_bob", (0.0,) * 5)) -> None:
    bag.tf("map", "camera", pose(1, 2, 3, yaw=0.3), 1.0)
    bag.camera_info("camera", 1.0, np.diag([0.5, 0.5, 1]) @ K, frame[0].shape, lens)


@pytest.mark.parametrize("storage", STORAGES)
def test_compressed_topics_give_the_cloud_of_raw_ones(storage: str, frame: Frame, tmp_path: Path) -> None:
    depth, labels, colours = frame
    with raw_bag(tmp_path / storage) as bag:
        begin(bag, frame)
        bag.image("/depth", "camera", 1.0, depth, "16UC1")
        bag.image("/metres", "camera", 1.0, (depth / 1000).astype(np.float32), "32FC1")
        bag.image("/labels", "camera", 1.0, labels, "mono8")
        bag.image("/colour", "camera", 1.0, colours, "rgb8")
        bag.compressed("/depth/compressed", "camera", 1.0, png(depth), "16UC1; png compressed ")
        for codec in ("png", "rvl"):
            data = compressed_depth(depth, codec)
            bag.compressed(f"/depth/{codec}", "camera", 1.0, data, f"16UC1; compressedDepth {codec}")
        data = compressed_depth((depth / 1000).astype(np.float32), "png")
        bag.compressed("/metres/compressedDepth", "camera", 1.0, data, "32FC1; compressedDepth png")
        bag.compressed("/labels/compressed", "camera", 1.0, png(labels), "mono8; png compressed ")
        bag.compressed("/colour/compressed", "camera", 1.0, png(colours), "rgb8; png compressed bgr8")
        bag.compressed("/colour/jpeg", "camera", 1.0, jpeg(colours), "rgb8; jpeg compressed bgr8")
    path = tmp_path / storage
    (expected,) = open_images(path, "/depth", "/labels", "/colour")
    for name in ("/depth/compressed", "/depth/png", "/depth/rvl"):
        (found,) = open_images(path, name, "/labels/compressed", "/colour/compressed")
        require_same(found, expected)
    (found,) = open_images(path, "/depth", "/labels", "/colour/jpeg")
    assert found.colours is not None
    assert expected.colours is not None
    assert np.abs(found.colours.astype(int) - expected.colours).mean() < 5
    (expected,) = open_images(path, "/metres", "/labels", "/colour")
    (found,) = open_images(path, "/metres/compressedDepth", "/labels", "/colour")
    np.testing.assert_array_equal(found.labels, expected.labels)
    np.testing.assert_allclose(found.points, expected.points, atol=1.5 * 10**2 / (100 * 101))
    with pytest.raises(FileFormatError, match=r"/depth at 1\.000 s: its colour image cannot be read: it is compr"):
        open_images(path, "/depth", "/labels", "/depth/png")[0]


@pytest.mark.parametrize("storage", ["run.bag", "run.mcap"])
def test_raw_images_of_a_lens(storage: str, frame: Frame, tmp_path: Path) -> None:
    depth, labels, _ = frame
    with raw_bag(tmp_path / storage) as bag:
        begin(bag, frame, ("rational_polynomial", (*LENS, 0.2, 0.05, 0.01)))
        bag.image("/labels", "camera", 1.0, labels, "mono8")
        bag.image("/depth/image_rect", "camera", 1.0, depth, "16UC1")
        data = compressed_depth(depth, "png")
        bag.compressed("/depth/image_raw/compressedDepth", "camera", 1.0, data, "16UC1; compressedDepth png")
    path = tmp_path / storage
    topics: dict[str, Any] = {"labels": "/labels", "camera_info": "/camera_info", "frame": "map"}
    (straight,) = open_log(path, depth="/depth/image_rect", **topics)
    (bent,) = open_log(path, depth="/depth/image_raw/compressedDepth", **topics)
    half = Pinhole(NYU_CAMERA.fx / 2, NYU_CAMERA.fy / 2, NYU_CAMERA.cx / 2, NYU_CAMERA.cy / 2)
    T = pose(1, 2, 3, yaw=0.3)
    for cloud, camera in ((straight, half), (bent, DistortedCamera(half, BrownConrady(*LENS, 0.2, 0.05, 0.01)))):
        points, valid = camera.back_project(depth / 1000, max_depth=10.0)
        np.testing.assert_allclose(cloud.points, points[valid] @ T[:3, :3].T + T[:3, 3], atol=1e-12)
    assert 0.9 * len(straight) < len(bent) < len(straight)  # the corners lie beyond the fold of this lens
