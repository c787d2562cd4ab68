"""OctoMap's files without OctoMap: round trips, and files that are damaged or hostile."""

from pathlib import Path

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.octomap import SemanticOctoMap

CLASSES = Classes(("floor", "wall"))
OT_HEADER = "# Octomap OcTree file\nid {}\nsize {}\nres 0.1\ndata\n"
BT_HEADER = "# Octomap OcTree binary file\nid OcTree\nsize {}\nres 0.1\ndata\n"
LEAF = np.float32(-1).tobytes() + b"\x00"
ONE_CHILD = np.float32(-1).tobytes() + b"\x01"


@pytest.fixture
def octomap() -> SemanticOctoMap:
    rng = np.random.default_rng(0)
    made = SemanticOctoMap(CLASSES, 0.1)
    for _ in range(2):
        points, labels = rng.uniform(-1, 1, (200, 3)), rng.integers(0, 2, 200, dtype=np.int32)
        made.update(LabelledCloud(points, CLASSES, labels, T_world_sensor=np.eye(4)))
    return made


def test_ot_keeps_the_occupancy(octomap: SemanticOctoMap, tmp_path: Path) -> None:
    octomap.write(tmp_path / "map.ot")
    read = SemanticOctoMap.read(tmp_path / "map.ot", CLASSES)
    assert read.resolution == octomap.resolution
    assert len(read) == len(octomap)
    np.testing.assert_array_equal(read.leaves().centres, octomap.leaves().centres)
    np.testing.assert_array_equal(read.leaves().log_odds, octomap.leaves().log_odds)
    with pytest.raises(InputError, match="no labels"):
        read.query([[0, 0, 0]])


def test_bt_keeps_what_is_occupied_and_free(octomap: SemanticOctoMap, tmp_path: Path) -> None:
    octomap.write(tmp_path / "map.bt")
    read = SemanticOctoMap.read(tmp_path / "map.bt", CLASSES)
    for theirs, ours in ((read.occupied, octomap.occupied), (read.free, octomap.free)):
        np.testing.assert_array_equal(theirs(pruned=False).centres, ours(pruned=False).centres)
    assert len(np.unique(read.leaves().log_odds)) == 2


def test_the_first_line_tells_the_format_not_the_name(octomap: SemanticOctoMap, tmp_path: Path) -> None:
    octomap.write(tmp_path / "map.bt")
    (tmp_path / "map.bt").rename(tmp_path / "map.ot")
    assert len(SemanticOctoMap.read(tmp_path / "map.ot", CLASSES)) == len(octomap)


def test_a_large_leaf_is_as_good_as_its_voxels(tmp_path: Path) -> None:
    path = tmp_path / "large.ot"
    path.write_bytes(OT_HEADER.format("OcTree", 11).encode() + ONE_CHILD * 10 + LEAF)
    read = SemanticOctoMap.read(path, CLASSES)
    assert len(read) == 8**6
    assert len(read.leaves()) == 1
    assert read.leaves().sizes[0] == pytest.approx(0.1 * 2**6)
    again = tmp_path / "again.ot"
    read.write(again)
    assert again.read_bytes().split(b"data\n")[1] == path.read_bytes().split(b"data\n")[1]


def test_an_empty_map(tmp_path: Path) -> None:
    for name in ("empty.ot", "empty.bt"):
        SemanticOctoMap(CLASSES, 0.25).write(tmp_path / name)
        read = SemanticOctoMap.read(tmp_path / name, CLASSES)
        assert len(read) == 0
        assert read.resolution == 0.25


@pytest.mark.parametrize("name", ["map.ot", "map.bt"])
def test_every_cut_and_every_extra_byte_is_noticed(octomap: SemanticOctoMap, name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    octomap.write(path)
    whole = path.read_bytes()
    cuts = np.random.default_rng(0).integers(0, len(whole), 40)
    for content in (*(whole[:cut] for cut in cuts), whole + b"\x00", whole + whole):
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match=name):
            SemanticOctoMap.read(path, CLASSES)


@pytest.mark.parametrize("name", ["map.ot", "map.bt"])
def test_flipped_bytes_are_refused_or_harmless(octomap: SemanticOctoMap, name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    octomap.write(path)
    whole = path.read_bytes()
    refused = 0
    for at in np.random.default_rng(1).integers(0, len(whole), 60):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        try:
            SemanticOctoMap.read(path, CLASSES).leaves()
        except FileFormatError:
            refused += 1
    assert refused > 5


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "first line"),
        (b"ply\n", "first line"),
        (b"# Octomap OcTree file\n", "id"),
        (b"# Octomap OcTree file\nid OcTree\nsize 1\ndata\n" + LEAF, "res"),
        (b"# Octomap OcTree file\nid OcTree\nsize one\nres 0.1\ndata\n" + LEAF, "size"),
        (b"# Octomap OcTree file\nid OcTree\nsize 1\nres 0.1\n", "no data line"),
        (b"# Octomap OcTree file\nid OcTree\nsize 1\nres -1\ndata\n" + LEAF, "cannot be"),
        (b"# Octomap OcTree file\nid OcTree\nsize -1\nres 0.1\ndata\n" + LEAF, "cannot be"),
        (b"# Octomap OcTree file\nid OcTree\nsize 1\nres nan\ndata\n" + LEAF, "cannot be"),
        (OT_HEADER.format("OcTreeStamped", 1).encode() + LEAF, "OcTreeStamped"),
        (OT_HEADER.format("OcTree", 10**15).encode() + LEAF, "the header says 1000000000000000 nodes"),
        (OT_HEADER.format("OcTree", 18).encode() + ONE_CHILD * 17 + LEAF, "deeper"),
        (OT_HEADER.format("OcTree", 1).encode() + np.float32(np.nan).tobytes() + b"\x00", "finite"),
        (OT_HEADER.format("OcTree", 1).encode() + LEAF, "more voxels"),  # the whole root
        (
            OT_HEADER.format("ColorOcTree", 6).encode() + (ONE_CHILD[:4] + b"abc\x01") * 5 + LEAF[:4] + b"abc\x00",
            "more",
        ),
        (BT_HEADER.format(2).encode() + b"\x00\x00", "no children"),
        (BT_HEADER.format(18).encode() + b"\x03\x00" * 17, "deeper"),
        (BT_HEADER.format(9).encode() + b"\x55\x55", "more voxels"),
    ],
)
def test_hostile_files(content: bytes, problem: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.ot"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=problem):
        SemanticOctoMap.read(path, CLASSES)


@pytest.mark.parametrize(("name", "colours"), [("map.txt", None), ("map.bt", "mean"), ("map.ot", "rainbow")])
def test_what_cannot_be_written(octomap: SemanticOctoMap, name: str, colours: str | None, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot write"):
        octomap.write(tmp_path / name, colours)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []
