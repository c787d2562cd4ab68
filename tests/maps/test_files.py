"""Map files: what is refused, and how."""

import json
from pathlib import Path

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.maps.files import load_map, save_map
from semgp.maps.gp import GPSemanticMap


@pytest.fixture
def saved(corner: LabelledCloud, tmp_path: Path) -> Path:
    gp_map = GPSemanticMap(corner.classes)
    gp_map.update(corner)
    save_map(gp_map, tmp_path / "map.semgp")
    return tmp_path / "map.semgp"


def rewritten(path: Path, **changes: object) -> Path:
    with np.load(path) as file:
        arrays = dict(file)
    header = json.loads(arrays.pop("header").tobytes()) | changes
    text = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    with path.open("wb") as out:
        np.savez(out, header=text, **arrays)
    return path


def test_a_newer_version_says_so(saved: Path) -> None:
    with pytest.raises(FileFormatError, match="newer semgp"):
        load_map(rewritten(saved, version=99))


def test_an_unknown_kind_says_so(saved: Path) -> None:
    with pytest.raises(FileFormatError, match="unknown kind 'voxblox'"):
        load_map(rewritten(saved, kind="voxblox"))


def test_another_format_says_so(saved: Path) -> None:
    with pytest.raises(FileFormatError, match="no map of semgp"):
        load_map(rewritten(saved, format="something"))


def test_other_files_say_so(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", points=np.zeros(3))
    with pytest.raises(FileFormatError, match="semgp build"):
        load_map(tmp_path / "other.npz")
    (tmp_path / "text.semgp").write_text("hello")
    with pytest.raises(FileFormatError, match="damaged"):
        load_map(tmp_path / "text.semgp")
    with pytest.raises(FileFormatError, match="no such file"):
        load_map(tmp_path / "absent.semgp")


def test_pickled_arrays_are_never_read(saved: Path) -> None:
    with np.load(saved) as file:
        arrays = dict(file)
    np.savez(saved.with_suffix(".npz"), **(arrays | {"map.points": np.array([print], dtype=object)}))
    with pytest.raises(FileFormatError, match="Python objects"):
        load_map(saved.with_suffix(".npz"))


def test_a_decompression_bomb_is_refused(tmp_path: Path) -> None:
    import zipfile

    path = tmp_path / "bomb.semgp"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("header.npy", "w") as member:
        for _ in range(1100):
            member.write(bytes(1 << 20))
    with pytest.raises(FileFormatError, match="bomb"):
        load_map(path)


def test_a_failed_write_leaves_the_old_file(saved: Path, corner: LabelledCloud) -> None:
    before = saved.read_bytes()

    class Broken(GPSemanticMap):
        def to_arrays(self):  # type: ignore[no-untyped-def]
            return {"bad": object()}, {}

    with pytest.raises(TypeError):
        save_map(Broken(corner.classes), saved)
    assert saved.read_bytes() == before
    assert list(saved.parent.iterdir()) == [saved]


def test_a_missing_folder_says_so(corner: LabelledCloud, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="folder"):
        save_map(GPSemanticMap(corner.classes), tmp_path / "absent" / "map.semgp")
