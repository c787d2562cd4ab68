"""NYU Depth V2 (folder and official file) and SemanticKITTI."""

import sys
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
    SEMANTIC_KITTI,
    SEMANTIC_KITTI_IDS,
    relabel,
)
from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.readers import NYUFolder, NYUMat, SemanticKITTISequence, open_nyu, open_scans, read
from semgp.readers.nyu_network import network_probability_image
from tests.reader_samples import (
    RAW_NAMES,
    SHAPE,
    TR,
    write_kitti_sequence,
    write_nyu_folder,
    write_nyu_mat,
)


def image(path: Path) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    return np.array(Image.open(path)).astype(np.int64)


# ---------------------------------------------------------------- NYU folder


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


# ---------------------------------------------------------------- the official .mat file


def test_nyu_mat_against_what_was_written(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = write_nyu_mat(tmp_path)
    source = open_nyu(path)
    assert list(source.frames) == [1, 2, 3]
    frame40, frame13 = source.read(2, classes=40), source.read(2)
    plain = ("books", "wall", "floor", None, "refrigerator", "otherprop", "bed")
    with h5py.File(path) as file:
        for row, column in ((0, 0), (5, 20), (23, 31), (11, 2)):
            n = row * SHAPE[1] + column
            raw = int(file["labels"][1, column, row])
            name = plain[raw - 1] if raw else None
            assert frame40.cloud.hard_labels[n] == (NYU40.index(name) if name else MISSING)
            assert frame40.cloud.points[n, 2] == file["depths"][1, column, row]
            assert frame13.cloud.colours is not None
            np.testing.assert_array_equal(frame13.cloud.colours[n], file["images"][1, :, column, row])
    np.testing.assert_array_equal(relabel(frame40.cloud.hard_labels, NYU40_TO_NYU13), frame13.cloud.labels)
    assert frame13.cloud.labelled.mean() < 1
    assert frame13.shape == SHAPE
    with pytest.raises(InputError, match="no frame 0"):
        source.read(0)
    with pytest.raises(InputError, match="without network output"):
        _ = frame13.network_labels


def test_nyu_mat_with_a_map_of_names(tmp_path: Path) -> None:
    path = write_nyu_mat(tmp_path)
    every = NYUMat(path, dict.fromkeys(RAW_NAMES, "lamp")).read(1, classes=40).cloud.hard_labels
    assert set(every.tolist()) == {MISSING, NYU40.index("lamp")}
    assert open_scans(path, nyu40_of_name={}, classes=40)[0].labelled.sum() == 0
    with pytest.raises(InputError, match="no class is called 'lampshade'"):
        NYUMat(path, {"wall": "lampshade"})


def test_nyu_mat_with_other_contents(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = write_nyu_mat(tmp_path)

    def refused(key: str, content: object, message: str) -> None:
        with h5py.File(path, "a") as file:
            file.move(key, "aside")
            file[key] = content
        with pytest.raises(FileFormatError, match=message):
            NYUMat(path).read(1)
        with h5py.File(path, "a") as file:
            del file[key]
            file.move("aside", key)

    height, width = SHAPE
    refused("labels", np.full((3, width, height), 8, np.uint16), "labels up to 8")
    refused("labels", np.zeros((3, height, width), np.uint16), "do not fit")
    refused("labels", np.zeros((3, width, height)), "labels of float64")
    refused("labels", np.zeros(3, np.uint16), "no MATLAB 7.3 file")
    refused("names", np.zeros((1, 7)), "no MATLAB 7.3 file")
    assert len(NYUMat(path).frames) == 3


def test_nyu_mat_without_h5py(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    (tmp_path / "a.mat").write_bytes(b"")
    with pytest.raises(MissingExtraError, match=r"semgp\[nyu\]"):
        open_scans(tmp_path / "a.mat")


# ---------------------------------------------------------------- SemanticKITTI


@pytest.mark.parametrize("world", ["velodyne", "camera"])
def test_kitti_against_a_loop(world: str, tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    scans = open_scans(path, world=world)
    assert len(scans) == 3
    kinds = {raw: name for name, ids in SEMANTIC_KITTI_IDS.items() for raw in ids}
    for cloud, number in zip(scans, (0, 1, 3)):
        rows = np.fromfile(path / "velodyne" / f"{number:06d}.bin", "<f4").reshape(-1, 4)
        ids = np.fromfile(path / "labels" / f"{number:06d}.label", "<u4") & 0xFFFF
        P = np.eye(4)
        P[2, 3] = number
        T = P @ TR if world == "camera" else np.linalg.inv(TR) @ P @ TR
        np.testing.assert_allclose(np.array(cloud.T_world_sensor), T, atol=1e-12)
        for n, (row, raw) in enumerate(zip(rows, ids.tolist())):
            np.testing.assert_allclose(cloud.points[n], (T @ [*row[:3], 1])[:3], atol=1e-9)
            label = cloud.hard_labels[n]
            assert (SEMANTIC_KITTI.names[label] if label >= 0 else None) == kinds.get(raw)
        np.testing.assert_array_equal(cloud.features, rows[:, 3:])
        assert cloud.feature_names == ("intensity",)


def test_kitti_velodyne_world_moves_along_x(tmp_path: Path) -> None:
    sequence = SemanticKITTISequence(write_kitti_sequence(tmp_path))
    np.testing.assert_allclose([T[:3, 3] for T in sequence.T_world_sensor], [[0, 0, 0], [1, 0, 0], [3, 0, 0]])


def test_kitti_labels_from_elsewhere_or_none(tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    sequence = SemanticKITTISequence(path)
    (path / "predictions").rename(tmp_path / "mine")
    predicted = sequence.scan(1, labels=tmp_path / "mine")
    assert (predicted.hard_labels != sequence.scan(1).hard_labels).any()
    assert sequence.scan(1, labels=None).labels is None
    with pytest.raises(FileFormatError, match=r"predictions.000001.label: no such file"):
        sequence.scan(1, labels="predictions")
    with pytest.raises(InputError, match="no scan 3"):
        sequence.scan(3)


def test_kitti_poses_of_the_odometry_benchmark(tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    expected = SemanticKITTISequence(path).T_world_sensor
    (tmp_path / "dataset" / "poses").mkdir()
    (path / "poses.txt").rename(tmp_path / "dataset" / "poses" / "08.txt")
    np.testing.assert_array_equal(SemanticKITTISequence(path).T_world_sensor, expected)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n" * 3, "has 3 rows, but scan 000003.bin needs row 4"),
        ("poses.txt", "1 0 0\n" * 4, "3 numbers where a transform has 12"),
        ("poses.txt", "1 0 0 0 0 2 0 0 0 0 1 0\n" * 4, "no rigid transform"),
        ("poses.txt", "a b c d e f g h i j k l\n" * 4, "could not convert"),
        ("poses.txt", "nan 0 0 0 0 1 0 0 0 0 1 0\n" * 4, "NaN"),
        ("poses.txt", "é", "no text file"),
        ("calib.txt", "P0: 1 2 3\n", "no line 'Tr: ...'"),
        ("calib.txt", "Tr: 1 2 3\n", "3 numbers"),
        ("velodyne/000001.bin", "x" * 17, "no positive multiple of 16"),
        ("velodyne/000001.bin", "\xff" * 16, "NaN or infinite"),
        ("velodyne/000001.bin", "", "no positive multiple of 16"),
        ("velodyne/scan.bin", "x" * 16, "named by its number"),
        ("labels/000001.label", "x" * 8, "has 2 labels for the 51 points"),
        ("labels/000001.label", "x" * 7, "no positive multiple of 4"),
    ],
)
def test_kitti_says_what_is_wrong(name: str, content: str, message: str, tmp_path: Path) -> None:
    path = write_kitti_sequence(tmp_path)
    (path / name).write_text(content, encoding="latin-1")
    with pytest.raises(FileFormatError, match=message) as caught:
        list(open_scans(path))
    assert str(path / name) in str(caught.value)


def test_kitti_bad_options(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'velodyne' or 'camera'"):
        open_scans(write_kitti_sequence(tmp_path), world="moon")
    with pytest.raises(FileFormatError, match=r"no velodyne/\*.bin"):
        SemanticKITTISequence(tmp_path)


def test_kitti_real_scans(data_dir: Path) -> None:
    scans = open_scans(data_dir / "semantickitti_08")
    assert len(scans) == 10
    first, last = scans[0], scans[-1]
    assert len(first) == 1_974_224 // 16
    np.testing.assert_allclose(np.array(first.T_world_sensor), np.eye(4), atol=1e-6)
    assert last.origin is not None
    assert 5 < last.origin[0] < 12
    assert abs(last.origin[2]) < 0.5
    road = SEMANTIC_KITTI.index("road")
    for cloud in (first, last):  # the lidar rides 1.73 m above the road, and z is up
        assert abs(np.median(cloud.points[cloud.hard_labels == road, 2]) + 1.73) < 0.2
    predicted = open_scans(data_dir / "semantickitti_08", labels="predictions")[0]
    both = first.labelled
    assert 0.7 < (predicted.hard_labels == first.hard_labels)[both].mean() < 0.95


def test_ade20k_order_is_that_of_the_probabilities(data_dir: Path) -> None:
    with np.load(data_dir / "nyu" / "0282_mosaic_prob128.npz") as file:
        most = np.bincount(file["p"].argmax(axis=2).ravel(), minlength=32).argmax()
    labels = image(data_dir / "nyu" / "0282_mosaic_ade32.png")
    assert ADE20K_32.names[most] == ADE20K_32.names[np.bincount(labels.ravel()).argmax()]
