"""PCD files, compressed or not: what is written is read again, and what is wrong is said."""

import contextlib
import struct
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError
from semgp.readers import read, read_pcd
from semgp.readers.lzf import unpacked
from tests.point_samples import Damage, damages, lzf_packed, survives
from tests.reader_samples import write_pcd

CLASSES = Classes(("floor mat", "wall", "überall"), ((1, 2, 3), (4, 5, 6), (250, 251, 252)))

tmp_path_is_fine = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)


@pytest.mark.parametrize("data", ["ascii", "binary"])
def test_pcd_round_trip(data: Literal["ascii", "binary"], tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    cloud = LabelledCloud(rng.normal(size=(50, 3)).astype(np.float32), CLASSES, rng.integers(-1, 3, 50, np.int32))
    again = read(write_pcd(tmp_path / "a.pcd", cloud, data), classes=CLASSES)
    np.testing.assert_array_equal(again.points, cloud.points)
    np.testing.assert_array_equal(again.labels, cloud.labels)
    assert again.classes == CLASSES


def test_pcd_with_colours_padding_and_vectors(tmp_path: Path) -> None:
    header = (
        "VERSION .7\nFIELDS x y z _ rgb normal _\nSIZE 4 4 4 1 4 4 1\nTYPE F F F U F F U\n"
        "COUNT 1 1 1 4 1 3 2\nWIDTH 2\nHEIGHT 1\nDATA binary\n"
    )
    row = struct.Struct("<fff4sI3f2s")
    rows = row.pack(1, 2, 3, b"", 0x0A0B0C, 0, 0, 1, b"") + row.pack(np.nan, 0, 0, b"", 0, 0, 0, 1, b"")
    (tmp_path / "a.pcd").write_bytes(header.encode() + rows)
    cloud = read_pcd(tmp_path / "a.pcd", features=("normal_0", "normal_2"))
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3]])
    np.testing.assert_array_equal(cloud.colours, [[10, 11, 12]])
    np.testing.assert_array_equal(cloud.features, [[0, 1]])


COLUMNS = (np.arange(600) % 7, np.arange(600) // 100, np.zeros(600))


def compressed_pcd(path: Path, size: int | None = None, cut: int = 0) -> Path:
    raw = b"".join(column.astype("<f4").tobytes() for column in COLUMNS)
    packed = lzf_packed(raw)
    header = pcd_header(WIDTH="600", POINTS="600", DATA="binary_compressed")
    sizes = struct.pack("<II", len(packed), len(raw) if size is None else size)
    path.write_bytes(header.encode() + sizes + packed[: len(packed) - cut])
    return path


def test_pcd_compressed(tmp_path: Path) -> None:
    path = compressed_pcd(tmp_path / "a.pcd")
    assert path.stat().st_size < 4000
    np.testing.assert_array_equal(read(path).points, np.stack(COLUMNS, axis=1))


@pytest.mark.parametrize(("size", "cut"), [(7199, 0), (2**32 - 1, 0), (None, 1), (None, 200)])
def test_pcd_compressed_that_lies(size: int | None, cut: int, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"is truncated|damaged"):
        read(compressed_pcd(tmp_path / "a.pcd", size, cut))


def test_pcd_compressed_bomb(tmp_path: Path) -> None:
    header = pcd_header(WIDTH="1", POINTS="350000000", DATA="binary_compressed")
    body = struct.pack("<II", 3, 4_200_000_000 % 2**32) + b"\x00\x00\x00"
    (tmp_path / "a.pcd").write_bytes(header.encode() + body)
    with pytest.raises(FileFormatError, match="3 bytes cannot unpack to 4200000000"):
        read(tmp_path / "a.pcd")


@pytest.fixture(scope="module")
def compressed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return compressed_pcd(tmp_path_factory.mktemp("pcd") / "a.pcd").read_bytes()


@tmp_path_is_fine
@given(damage=damages)
def test_pcd_compressed_and_damaged(damage: Damage, compressed: bytes, tmp_path: Path) -> None:
    survives(tmp_path / "a.pcd", compressed, damage)


@given(raw=st.binary(max_size=400) | st.lists(st.sampled_from([b"ab", b"abc", b"\0" * 40])).map(b"".join))
def test_lzf_round_trip(raw: bytes) -> None:
    assert unpacked(Path("a.pcd"), lzf_packed(raw), len(raw)).tobytes() == raw


@given(packed=st.binary(max_size=60), size=st.integers(0, 300))
def test_lzf_of_noise(packed: bytes, size: int) -> None:
    with contextlib.suppress(FileFormatError):
        assert len(unpacked(Path("a.pcd"), packed, size)) == size


def pcd_header(**changes: str) -> str:
    lines = {"FIELDS": "x y z", "SIZE": "4 4 4", "TYPE": "F F F", "COUNT": "1 1 1", "WIDTH": "1", "HEIGHT": "1"}
    lines |= {"POINTS": "1", "DATA": "ascii"} | changes
    return "".join(f"{key} {value}\n" for key, value in lines.items() if value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"FIELDS": "x y w"}, "has no z; its fields are x, y, w"),
        ({"DATA": "binary_compressed"}, "is truncated or its header lies"),
        ({"DATA": "morse"}, "known are ascii, binary and binary_compressed"),
        ({"SIZE": "4 4"}, "different lengths"),
        ({"SIZE": "4 4 3"}, "unknown type and size F3"),
        ({"TYPE": ""}, "without TYPE"),
        ({"FIELDS": "x y z y", "SIZE": "4 4 4 4", "TYPE": "F F F F", "COUNT": "1 1 1 1"}, "told apart"),
        ({"COUNT": "1 1 99999999"}, "99999999 elements"),
        ({"POINTS": "many"}, "no sensible number"),
        ({"POINTS": "2"}, "truncated"),
        ({"POINTS": "1000000000000", "DATA": "binary"}, "truncated"),
        ({"POINTS": "", "WIDTH": ""}, "no sensible number"),
    ],
)
def test_pcd_says_what_is_wrong(changes: dict[str, str], message: str, tmp_path: Path) -> None:
    (tmp_path / "a.pcd").write_text(pcd_header(**changes) + "1 2 3\n")
    with pytest.raises(FileFormatError, match=message):
        read_pcd(tmp_path / "a.pcd")


@pytest.mark.parametrize("content", [b"", b"x y z\n1 2 3\n", b"\xff\xfe\n", b"FIELDS x\nFIELDS x\n"])
def test_pcd_that_is_none(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.pcd").write_bytes(content)
    with pytest.raises(FileFormatError):
        read_pcd(tmp_path / "a.pcd")


def test_stanford_pieces(data_dir: Path) -> None:
    piece = read(data_dir / "stanford_room" / "22.pcd")
    assert len(piece) == 1293
    assert set(piece.hard_labels.tolist()) == {9}
    np.testing.assert_allclose(piece.points[0], [14.9305, 1.0985, 0.15700001], atol=1e-6)
    assert np.ptp(piece.points, axis=0).max() < 10
