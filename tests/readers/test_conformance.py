"""What all readers have in common: the registry, the lazy sequence, and what damaged files do."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.readers import READERS, Reader, Scans, open_scans, read
from semgp.writers import write_npz, write_ply
from tests.point_samples import sample_e57, sample_las, sample_laz, sample_text
from tests.reader_samples import (
    write_kitti_bin,
    write_kitti_sequence,
    write_log,
    write_nyu_folder,
    write_nyu_mat,
    write_pcd,
    write_point_folder,
)
from tests.rgbd_samples import write_open3d, write_scannet, write_seven_scenes, write_tum

CLASSES = Classes(("floor mat", "wall"), ((1, 2, 3), (4, 5, 6)))


def small_cloud(n: int = 12) -> LabelledCloud:
    rng = np.random.default_rng(0)
    return LabelledCloud(
        rng.normal(size=(n, 3)),
        CLASSES,
        rng.integers(-1, 2, n, np.int32),
        colours=rng.integers(0, 256, (n, 3), np.uint8),
    )


def sample_ply(folder: Path) -> Path:
    cloud = small_cloud()
    write_ply(folder / "a.ply", cloud.points, classes=CLASSES, colours=cloud.colours, label=cloud.hard_labels)
    return folder / "a.ply"


def sample_pcd(folder: Path) -> Path:
    return write_pcd(folder / "a.pcd", small_cloud(), "binary")


def sample_npz(folder: Path) -> Path:
    write_npz(folder / "a.npz", small_cloud())
    return folder / "a.npz"


SAMPLES: dict[str, tuple[Callable[[Path], Path], int]] = {
    "ply": (sample_ply, 1),
    "pcd": (sample_pcd, 1),
    "npz": (sample_npz, 1),
    "las": (sample_las, 1),
    "laz": (sample_laz, 1),
    "e57": (sample_e57, 2),
    "csv": (sample_text, 1),
    "xyz": (lambda folder: sample_text(folder, ".xyz"), 1),
    "txt": (lambda folder: sample_text(folder, ".txt"), 1),
    "asc": (lambda folder: sample_text(folder, ".asc"), 1),
    "nyu": (write_nyu_folder, 2),
    "nyu-mat": (write_nyu_mat, 3),
    "kitti-bin": (write_kitti_bin, 1),
    "semantickitti": (write_kitti_sequence, 3),
    "point-folder": (write_point_folder, 3),
    "log": (write_log, 3),
    "7scenes": (write_seven_scenes, 3),
    "scannet": (write_scannet, 3),
    "open3d": (write_open3d, 3),
    "tum": (write_tum, 3),
}
"""One row a reader: what writes a sample, and how many scans that has."""

by_reader = pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)


def files_of(path: Path) -> list[Path]:
    return sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]


def read_all(path: Path) -> list[LabelledCloud]:
    """Read every scan; a damaged file may lose scans, but all that is read must be sound."""
    clouds = list(open_scans(path))
    assert all(np.isfinite(cloud.points).all() for cloud in clouds)
    return clouds


def refusal(path: Path) -> str | None:
    """Read every scan; return the error's message, None without an error."""
    try:
        read_all(path)
    except InputError as error:
        return str(error)
    return None


def test_every_reader_has_a_sample() -> None:
    assert {reader.name for reader in READERS} == SAMPLES.keys()


@by_reader
def test_a_sample_is_taken_by_its_reader_alone_and_read(reader: Reader, tmp_path: Path) -> None:
    write, n_scans = SAMPLES[reader.name]
    path = write(tmp_path)
    assert [r.name for r in READERS if r.matches(path)] == [reader.name]
    scans = open_scans(str(path))
    assert len(scans) == n_scans
    for cloud in scans:
        assert isinstance(cloud, LabelledCloud)
        assert len(cloud)
        assert cloud.labelled.any()
    np.testing.assert_array_equal(scans[-1].points, scans[n_scans - 1].points)
    assert [len(cloud) for cloud in scans[1:]] == [len(cloud) for cloud in scans][1:]


@by_reader
def test_scans_are_read_when_asked_for(reader: Reader, tmp_path: Path) -> None:
    path = SAMPLES[reader.name][0](tmp_path)
    scans = open_scans(path)
    for file in files_of(path):
        file.write_bytes(b"")
    with pytest.raises(FileFormatError):
        scans[0]


@by_reader
def test_truncated_files(reader: Reader, tmp_path: Path) -> None:
    path = SAMPLES[reader.name][0](tmp_path)
    rng = np.random.default_rng(1)
    messages = []
    for file in files_of(path):
        whole = file.read_bytes()
        for length in [0, 1, len(whole) // 2, len(whole) - 1, *rng.integers(0, len(whole), 8)]:
            file.write_bytes(whole[:length])
            messages.append(refusal(path))
        file.write_bytes(whole)
    refused = [message for message in messages if message]
    assert len(refused) >= 5
    assert all(str(path) in message for message in refused)
    assert refusal(path) is None


@by_reader
def test_flipped_bytes(reader: Reader, tmp_path: Path) -> None:
    path = SAMPLES[reader.name][0](tmp_path)
    files = files_of(path)
    rng = np.random.default_rng(2)
    messages = []
    for trial in range(150):
        file = files[trial % len(files)]
        whole = file.read_bytes()
        damaged = np.frombuffer(whole, np.uint8).copy()
        damaged[rng.integers(0, min(len(whole), 600), 2)] = rng.integers(0, 256, 2)
        file.write_bytes(damaged.tobytes())
        messages.append(refusal(path))
        file.write_bytes(whole)
    refused = [message for message in messages if message]
    assert len(refused) >= (0 if reader.name == "kitti-bin" else 5)  # which is numbers alone: most bytes will do
    assert all(str(path) in message for message in refused)


@by_reader
def test_missing_files(reader: Reader, tmp_path: Path) -> None:
    path = SAMPLES[reader.name][0](tmp_path)
    for file in files_of(path):
        whole = file.read_bytes()
        file.unlink()
        message = refusal(path)
        assert message is None or str(path) in message
        file.write_bytes(whole)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file or folder"):
        open_scans(tmp_path / "nothing.ply")


@pytest.mark.parametrize("name", ["a.doc", "folder"])
def test_unknown_formats_list_the_known_ones(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text("1 2 3") if path.suffix else path.mkdir()
    with pytest.raises(InputError) as caught:
        open_scans(path)
    assert all(reader.layout in str(caught.value) for reader in READERS)


def test_read_gives_the_one_cloud(tmp_path: Path) -> None:
    assert len(read(sample_npz(tmp_path))) == 12
    with pytest.raises(InputError, match="holds 3 scans"):
        read(write_kitti_sequence(tmp_path))


def test_scans_are_a_sequence() -> None:
    seen: list[int] = []

    def scan(i: int) -> LabelledCloud:
        seen.append(i)
        return small_cloud(i)

    scans = Scans((5, 6, 7, 8), scan)
    assert len(scans) == 4
    assert seen == []
    assert len(scans[1]) == 6
    assert [len(cloud) for cloud in scans[2:]] == [7, 8]
    assert seen == [6, 7, 8]
    with pytest.raises(IndexError):
        scans[4]
