"""Depth, label and colour images of a camera that moves."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semgp.classes import MISSING, Classes
from semgp.errors import FileFormatError, InputError
from semgp.logs.pixels import COLOUR_ENCODINGS, DEPTH_ENCODINGS, LABEL_ENCODINGS, pixels_of_image
from semgp.logs.reader import open_log
from semgp.scene import DepthCamera, synthetic_room
from tests.log_samples import RawBag, message, raw_bag

ROOM = synthetic_room(views=24, camera=DepthCamera(width=40, height=30))
PINHOLE = ROOM.camera.pinhole
K = np.array([[PINHOLE.fx, 0, PINHOLE.cx], [0, PINHOLE.fy, PINHOLE.cy], [0, 0, 1]])
TOPICS: dict[str, Any] = {"depth": "/depth", "labels": "/labels", "camera_info": "/camera_info"}


def write_frames(bag: RawBag, *, late: float = 0.005, metres: bool = False, bgr: bool = False) -> None:
    """Write three frames; labels lag behind depth, and those of the last one are lost."""
    for k in range(3):
        scan, t = ROOM.scan(k), 10.0 + k
        bag.tf("map", "camera", ROOM.pose(k), t)
        if metres:
            bag.image("/depth", "camera", t, scan.depth.astype("<f4"), "32FC1")
        else:
            bag.image("/depth", "camera", t, np.round(1000 * scan.depth).astype("<u2"), "16UC1")
        bag.camera_info("camera", t, K, scan.depth.shape)
        bag.image(
            "/colour", "camera", t, scan.rgb[..., ::-1].copy() if bgr else scan.rgb, "bgr8" if bgr else "rgb8"
        )
        if k < 2:
            labels = np.where(scan.label % 5 == 0, 255, scan.label).astype(np.uint8)
            bag.image("/labels", "camera", t + late, labels, "mono8")


@pytest.mark.parametrize(("name", "metres", "bgr"), [("run.mcap", False, False), ("run.bag", True, True)])
def test_frames_become_clouds(name: str, metres: bool, bgr: bool, tmp_path: Path) -> None:
    with raw_bag(tmp_path / name) as bag:
        write_frames(bag, metres=metres, bgr=bgr)
    scans = open_log(tmp_path / name, classes=ROOM.classes, colour="/colour", **TOPICS)
    assert len(scans) == 2
    assert [stamp for stamp, _ in scans.skipped] == [12.0]
    assert "no label image within 0.02 s" in scans.skipped[0][1]
    for k, cloud in enumerate(scans):
        seen = ROOM.scan(k).truth
        measured = ROOM.scan(k).observed.points
        np.testing.assert_allclose(cloud.points, measured, atol=1e-6 if metres else 1e-3)
        np.testing.assert_array_equal(cloud.colours, seen.colours)
        expected = np.where(seen.hard_labels % 5 == 0, MISSING, seen.hard_labels)
        np.testing.assert_array_equal(cloud.labels, expected)
        np.testing.assert_allclose(cloud.T_world_sensor, ROOM.pose(k), atol=1e-9)  # type: ignore[arg-type]
        assert cloud.image_shape == (30, 40)


def test_labels_of_another_moment_are_not_taken(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_frames(bag, late=0.1)
    with pytest.raises(InputError, match=r"none of 3 scans can be used.*no label image within 0.02 s"):
        open_log(tmp_path / "run.mcap", **TOPICS)
    assert len(open_log(tmp_path / "run.mcap", tolerance=0.2, **TOPICS)) == 2


def test_every_third_pixel(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_frames(bag)
    whole = open_log(tmp_path / "run.mcap", **TOPICS)[0]
    thin = open_log(tmp_path / "run.mcap", stride=3, **TOPICS)[0]
    assert whole.pixels is not None
    np.testing.assert_array_equal(thin.points, whole.points[(whole.pixels % 3 == 1).all(axis=1)])
    with pytest.raises(InputError, match="stride"):
        open_log(tmp_path / "run.mcap", stride=-1, **TOPICS)[0]


def test_raw_ids(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_frames(bag)
    ids = Classes(("some", "other"), ids=((1, 2), (3,)))
    cloud = open_log(tmp_path / "run.mcap", classes=ids, **TOPICS)[0]
    raw = ROOM.scan(0).truth.hard_labels
    expected = np.select([np.isin(raw, (1, 2)), raw == 3], [0, 1], MISSING)
    np.testing.assert_array_equal(cloud.labels, expected)


def test_topics_that_lack_are_asked_for(tmp_path: Path) -> None:
    with raw_bag(tmp_path / "run.mcap") as bag:
        write_frames(bag)
    with pytest.raises(InputError, match=r"depth images need labels=.*and camera_info="):
        open_log(tmp_path / "run.mcap", depth="/depth")
    with pytest.raises(InputError, match="go with depth images: give depth="):
        open_log(tmp_path / "run.mcap", labels="predictions")
    with pytest.raises(InputError, match="not of both"):
        open_log(tmp_path / "run.mcap", topic="/points", **TOPICS)
    with pytest.raises(InputError, match="topic /camera_info holds sensor_msgs/msg/CameraInfo"):
        open_log(tmp_path / "run.mcap", depth="/depth", labels="/camera_info", camera_info="/camera_info")
    with pytest.raises(FileFormatError, match="its label image cannot be read: it is 'rgb8', not one of mono8"):
        open_log(tmp_path / "run.mcap", depth="/depth", labels="/colour", camera_info="/camera_info")[0]


@pytest.mark.parametrize("encoding", sorted({*DEPTH_ENCODINGS, *LABEL_ENCODINGS, *COLOUR_ENCODINGS}))
@pytest.mark.parametrize("big", [0, 1])
def test_encodings_of_either_byte_order_with_padded_rows(encoding: str, big: int) -> None:
    kinds = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4", "16SC1": "i2", "32SC1": "i4"}
    channels = 4 if "a8" in encoding else 3 if encoding in COLOUR_ENCODINGS else 1
    pixels = (
        np.arange(6 * channels).reshape(2, 3, channels).astype((">" if big else "<") + kinds.get(encoding, "u1"))
    )
    rows = [row.tobytes() + b"\xff\xff\xff" for row in pixels]
    image = message(
        encoding=encoding,
        is_bigendian=big,
        height=2,
        width=3,
        step=len(rows[0]),
        data=np.frombuffer(b"".join(rows), "u1"),
    )
    found = pixels_of_image(image)
    np.testing.assert_array_equal(found, pixels if channels > 1 else pixels[..., 0])
    assert found.dtype.isnative
    for change, problem in (
        ({"step": 1}, "rows of 1 bytes"),
        ({"height": 3}, "where 3 rows need"),
        ({"width": 0}, "no"),
    ):
        with pytest.raises(InputError, match=problem):
            pixels_of_image(message(**vars(image) | change))
