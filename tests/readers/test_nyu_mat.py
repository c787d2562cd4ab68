"""NYU Depth V2 as the official .mat file."""

import sys
from pathlib import Path

import numpy as np
import pytest

from semgp.classes import MISSING
from semgp.conventions import (
    NYU40,
    NYU40_TO_NYU13,
    relabel,
)
from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.readers import NYUMat, open_nyu, open_scans
from tests.reader_samples import (
    RAW_NAMES,
    SHAPE,
    write_nyu_mat,
)


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
