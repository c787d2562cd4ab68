"""NYU Depth V2 as a folder of images, and a network's output beside them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgp.camera import NYU_CAMERA
from semgp.classes import MISSING
from semgp.conventions import (
    ADE20K_32,
    ADE20K_32_TO_NYU13,
    NYU13,
    NYU40,
    NYU40_TO_NYU13,
    relabel,
)
from semgp.errors import FileFormatError, InputError
from semgp.readers import NYUFolder, open_nyu, open_scans, read
from semgp.readers.nyu_network import network_probability_image
from tests.reader_samples import (
    SHAPE,
    write_nyu_folder,
)


def image(path: Path) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    return np.array(Image.open(path)).astype(np.int64)


def test_nyu_folder_against_a_loop(tmp_path: Path) -> None:
    folder = write_nyu_folder(tmp_path)
    source = NYUFolder(folder)
    assert source.frames == (7, 12)
    depth, label13, label40 = (image(folder / f"0012_{k}.png") for k in ("depth_mm", "label13", "label40"))
    network, rgb = image(folder / "0012_mosaic_nyu13.png"), image(folder / "0012_rgb.jpg")
    frame13, frame40 = source.read(12), source.read(12, classes=40)
    assert (frame13.cloud.classes, frame40.cloud.classes) == (NYU13, NYU40)
    assert (frame13.number, frame13.shape) == (12, SHAPE)
    n = 0
    for v in range(SHAPE[0]):
        for u in range(SHAPE[1]):
            if depth[v, u] in (0, 65535) or depth[v, u] > 10_000:
                continue
            d = depth[v, u] / 1000
            x, y = (u - NYU_CAMERA.cx) * d / NYU_CAMERA.fx, (v - NYU_CAMERA.cy) * d / NYU_CAMERA.fy
            np.testing.assert_allclose(frame13.cloud.points[n], [x, y, d], rtol=1e-12)
            assert frame13.cloud.hard_labels[n] == label13[v, u] - 1
            assert frame40.cloud.hard_labels[n] == label40[v, u] - 1
            assert frame13.cloud.pixels is not None
            assert tuple(frame13.cloud.pixels[n]) == (v, u)
            assert frame13.cloud.colours is not None
            assert tuple(frame13.cloud.colours[n]) == tuple(rgb[v, u])
            n += 1
    assert n == len(frame13.cloud) == SHAPE[0] * SHAPE[1] - 3
    valid = (depth > 0) & (depth <= 10_000)
    np.testing.assert_array_equal(frame13.network_labels, network[valid] - 1)
    np.testing.assert_array_equal(frame40.network_labels, network[valid] - 1)


def test_nyu_depth_65535_is_no_depth_at_any_range(tmp_path: Path) -> None:
    from semgp.readers.images import read_depth

    depth = read_depth(write_nyu_folder(tmp_path) / "0012_depth_mm.png")
    np.testing.assert_array_equal(np.isnan(depth[0, :4]), [True, True, False, False])
    assert depth[0, 2] == 10.001


def test_network_probability_against_a_loop(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    p = np.round(255 * rng.dirichlet(np.ones(32), (4, 5))).astype(np.uint8)
    np.savez(tmp_path / "p.npz", p=p)
    found = network_probability_image(tmp_path / "p.npz", (8, 15))
    coarse = np.zeros((4, 5, 13))
    for r in range(4):
        for c in range(5):
            for ade in range(32):
                if ADE20K_32_TO_NYU13[ade] >= 0:
                    coarse[r, c, ADE20K_32_TO_NYU13[ade]] += p[r, c, ade] / p[r, c].astype(int).sum()
    for r in range(8):
        for c in range(15):
            a, b = min(r / 2, 3.0), min(c / 3, 4.0)
            r0, c0 = min(int(a), 2), min(int(b), 3)
            expected = np.zeros(13)
            for i, wi in ((r0, 1 - (a - r0)), (r0 + 1, a - r0)):
                for j, wj in ((c0, 1 - (b - c0)), (c0 + 1, b - c0)):
                    expected += wi * wj * coarse[i, j]
            np.testing.assert_allclose(found[r, c], expected, atol=1e-6)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"q": np.ones(3)}, "must hold p"),
        ({"p": np.ones((4, 4, 31), np.uint8)}, "must hold p"),
        ({"p": np.ones((4, 4, 32))}, "must hold p"),
        ({"p": np.ones((1, 4, 32), np.uint8)}, "must hold p"),
        ({"p": np.zeros((4, 4, 32), np.uint8)}, "all probabilities are zero"),
    ],
)
def test_network_files_that_are_refused(
    arrays: dict[str, np.ndarray[tuple[int, ...], np.dtype[np.uint8]]], message: str, tmp_path: Path
) -> None:
    np.savez(tmp_path / "p.npz", allow_pickle=False, **arrays)
    with pytest.raises(FileFormatError, match=message):
        network_probability_image(tmp_path / "p.npz", SHAPE)


def test_nyu_options_of_the_registry(tmp_path: Path) -> None:
    folder = write_nyu_folder(tmp_path)
    source = NYUFolder(folder)
    one = read(folder / "0012_depth_mm.png", classes=40)
    np.testing.assert_array_equal(one.labels, source.read(12, 40).cloud.labels)
    predicted = open_scans(folder, labels="predictions")[1]
    np.testing.assert_array_equal(predicted.labels, source.read(12).network_labels)
    for options in ({"classes": 14}, {"labels": "guesses"}, {"labels": "predictions", "classes": 40}):
        with pytest.raises(InputError):
            open_scans(folder, **options)


def test_nyu_frames_that_are_not_there(tmp_path: Path) -> None:
    source = NYUFolder(write_nyu_folder(tmp_path))
    with pytest.raises(InputError, match="no frame 8: there are 2 from 7 to 12"):
        source.read(8)
    with pytest.raises(InputError, match="none of 14"):
        source.read(7, classes=14)  # type: ignore[arg-type]
    with pytest.raises(FileFormatError, match="no NYU folder"):
        NYUFolder(tmp_path)


def test_nyu_images_that_are_refused(tmp_path: Path) -> None:
    folder = write_nyu_folder(tmp_path)
    source = NYUFolder(folder)

    def refused(name: str, content: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], message: str) -> None:
        whole = (folder / name).read_bytes()
        Image.fromarray(content).save(folder / name)
        with pytest.raises(FileFormatError, match=message):
            source.read(7)
        (folder / name).write_bytes(whole)

    refused("0007_label13.png", np.full(SHAPE, 14, np.uint8), "between 0 and 13")
    refused("0007_label13.png", np.zeros((3, 4), np.uint8), "are expected")
    refused("0007_depth_mm.png", np.zeros(SHAPE, np.uint8), "no 16-bit depth image")
    refused("0007_rgb.jpg", np.zeros(SHAPE, np.uint8), "no RGB image")


def test_nyu_real_frames(data_dir: Path) -> None:
    source = open_nyu(data_dir / "nyu")
    assert set(source.frames) >= {282, 374, 555, 965}
    frame = source.read(282)
    assert len(frame.cloud) == 480 * 640
    assert frame.cloud.image_shape == (480, 640)
    np.testing.assert_array_equal(
        relabel(source.read(282, classes=40).cloud.hard_labels, NYU40_TO_NYU13), frame.cloud.labels
    )
    p = frame.network_probability
    assert p.shape == (480 * 640, 13)
    assert (p.sum(axis=1) <= 1 + 1e-5).all()
    assert not p[:, [NYU13.index("books"), NYU13.index("tv")]].any()
    known = frame.network_labels != MISSING
    assert (p.argmax(axis=1) == frame.network_labels)[known].mean() > 0.98


def test_ade20k_order_is_that_of_the_probabilities(data_dir: Path) -> None:
    with np.load(data_dir / "nyu" / "0282_mosaic_prob128.npz") as file:
        most = np.bincount(file["p"].argmax(axis=2).ravel(), minlength=32).argmax()
    labels = image(data_dir / "nyu" / "0282_mosaic_ade32.png")
    assert ADE20K_32.names[most] == ADE20K_32.names[np.bincount(labels.ravel()).argmax()]
