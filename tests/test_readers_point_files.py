"""PLY, PCD and npz: what is written is read again, and what is wrong is said."""

import contextlib
import io
import struct
import zipfile
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.readers import read, read_npz, read_pcd, read_ply
from semgp.readers.lzf import unpacked
from semgp.writers import write_npz, write_ply
from tests.point_samples import Damage, damages, lzf_packed, survives
from tests.reader_samples import write_pcd

CLASSES = Classes(("floor mat", "wall", "überall"), ((1, 2, 3), (4, 5, 6), (250, 251, 252)))
POINTS = np.array([[0.5, 1.5, -2.5], [1, 2, 3], [-4, 5, 6.25]])

tmp_path_is_fine = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)


def ply(path: Path, header: str, body: bytes = b"") -> Path:
    path.write_bytes(header.encode() + body)
    return path


SIGNALLING = struct.pack("<I", 0x7F810000)
"""A NaN that raises a flag in the processor whenever it is computed with."""

FLOATS = ("x", "y", "z", "label", "prob_0", "prob_1", "red", "green", "blue", "intensity")


@pytest.mark.parametrize(
    ("at", "problem"),
    [
        *((at, None) for at in range(4)),
        *((at, "weights has NaN") for at in (4, 5)),
        *((at, "colours that are not whole numbers") for at in (6, 7, 8)),
        (9, "features has NaN"),
    ],
)
def test_a_signalling_nan_is_a_nan_like_any_other(at: int, problem: str | None, tmp_path: Path) -> None:
    properties = "".join(f"property float {name}\n" for name in FLOATS)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex 2\n{properties}end_header\n"
    body = bytearray(struct.pack("<20f", *2 * (0, 1, 2, 1, 0.5, 0.5, 10, 20, 30, 4)))
    body[4 * at : 4 * at + 4] = SIGNALLING
    path = ply(tmp_path / "a.ply", header, bytes(body))
    if problem:
        with pytest.raises(FileFormatError, match=problem):
            read(path, features=("intensity",))
    else:
        cloud = read(path, features=("intensity",))
        assert len(cloud) == (2 if at == 3 else 1)


def ascii_ply(path: Path, properties: str, rows: str, count: int | None = None) -> Path:
    """Write an ASCII PLY file; `properties` is a list such as "float x, uchar label"."""
    lines = [f"property {p.strip()}" for p in properties.split(",")]
    n = len(rows.splitlines()) if count is None else count
    header = "\n".join(["ply", "format ascii 1.0", f"element vertex {n}", *lines, "end_header", ""])
    return ply(path, header, rows.encode())


XYZ = "float x, float y, float z"

# ---------------------------------------------------------------- PLY


@tmp_path_is_fine
@given(
    points=hnp.arrays(np.float64, st.tuples(st.integers(0, 20), st.just(3)), elements=st.floats(-5e6, 5e6)),
    seed=st.integers(0, 2**32 - 1),
)
def test_ply_round_trip(points: np.ndarray[Any, Any], seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    n = len(points)
    labels = rng.integers(-1, 3, n)
    colours = rng.integers(0, 256, (n, 3), np.uint8)
    write_ply(tmp_path / "a.ply", points, classes=CLASSES, colours=colours, label=labels, entropy=rng.random(n))
    cloud = read(tmp_path / "a.ply", features=("entropy",))
    np.testing.assert_allclose(cloud.points, points, atol=1e-4, rtol=0)
    np.testing.assert_array_equal(cloud.labels, labels)
    np.testing.assert_array_equal(cloud.colours, colours)
    assert cloud.classes == CLASSES
    assert cloud.feature_names == ("entropy",)


def test_ply_with_probabilities(tmp_path: Path) -> None:
    p = np.array([[0.2, 0.3, 0.5], [1, 0, 0], [0.25, 0.25, 0.5]])
    write_ply(tmp_path / "a.ply", POINTS, classes=CLASSES, probability=p, label=[2, 0, MISSING])
    cloud = read_ply(tmp_path / "a.ply")
    assert cloud.classes == CLASSES
    assert cloud.weights is not None
    np.testing.assert_allclose(cloud.weights[:2], p[:2], atol=1e-7)
    np.testing.assert_array_equal(cloud.labelled, [True, True, False])
    header = (tmp_path / "a.ply").read_bytes()
    assert b"property float p_floor_mat\n" in header


def test_ply_bytes_are_what_the_format_says(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", [[1, 2, 3]], colours=np.array([[7, 8, 9]], np.uint8), label=[-1], variance=[0.5])
    header, _, body = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")
    assert header.decode().splitlines() == [
        *("ply", "format binary_little_endian 1.0", "comment written by semgp", "element vertex 1"),
        *("property float x", "property float y", "property float z"),
        *("property uchar red", "property uchar green", "property uchar blue"),
        *("property int label", "property float variance"),
    ]
    assert struct.unpack("<fffBBBif", body) == (1, 2, 3, 7, 8, 9, -1, 0.5)


def test_ply_keeps_large_coordinates(tmp_path: Path) -> None:
    utm = np.array([[5e6 + 0.001, 4.2e5, 100]])
    write_ply(tmp_path / "a.ply", utm)
    np.testing.assert_array_equal(read_ply(tmp_path / "a.ply").points, utm)
    assert b"property double x" in (tmp_path / "a.ply").read_bytes()


@pytest.mark.parametrize("order", ["<", ">"])
def test_ply_binary_of_both_byte_orders(order: str, tmp_path: Path) -> None:
    form = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    header = (
        f"ply\nformat {form} 1.0\ncomment from elsewhere\nelement camera 2\nproperty short a\n"
        "element vertex 2\nproperty double x\nproperty float y\nproperty float32 z\nproperty uint8 class\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = struct.pack(f"{order}hhdffBdffB", 5, 6, 1.1, 2, 3, 4, -1.1, -2, -3, 255)
    cloud = read_ply(ply(tmp_path / "a.ply", header, rows + b"\x03" + bytes(12)))
    np.testing.assert_array_equal(cloud.points, [[1.1, 2, 3], [-1.1, -2, -3]])
    np.testing.assert_array_equal(cloud.labels, [4, MISSING])
    assert len(cloud.classes) == 5


def test_ply_ascii_with_faces_before_and_after(tmp_path: Path) -> None:
    header = (
        "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\n"
        "element vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    cloud = read_ply(ply(tmp_path / "a.ply", header, b"3 0 1 2\n\n1 2 3\r\n4 5 6\n3 0 1 2\n"))
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3], [4, 5, 6]])
    assert cloud.labels is None


def test_ply_with_windows_line_ends(tmp_path: Path) -> None:
    path = ascii_ply(tmp_path / "a.ply", XYZ, "1 2 3\n4 5 6\n")
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert len(read_ply(path)) == 2


def test_ply_from_cloudcompare(tmp_path: Path) -> None:
    rows = "1 2 3 1.0\n4 5 6 nan\n7 8 9 -1\n"
    cloud = read_ply(ascii_ply(tmp_path / "a.ply", XYZ + ", float scalar_Label", rows))
    np.testing.assert_array_equal(cloud.labels, [1, MISSING, MISSING])


def test_ply_leaves_out_points_without_return(tmp_path: Path) -> None:
    cloud = read_ply(ascii_ply(tmp_path / "a.ply", XYZ + ", int label", "1 2 3 0\nnan nan nan 1\n4 5 6 2\n"))
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(cloud.labels, [0, 2])


def test_ply_with_numbered_soft_labels(tmp_path: Path) -> None:
    rows = "1 2 3 .25 .75\n"
    cloud = read_ply(ascii_ply(tmp_path / "a.ply", XYZ + ", float prob_1, float prob_0", rows))
    np.testing.assert_array_equal(cloud.weights, [[0.75, 0.25]])
    assert cloud.classes.names == ("class 0", "class 1")
    named = read_ply(ascii_ply(tmp_path / "b.ply", XYZ + ", float p_tree, float p_car", rows))
    assert named.classes.names == ("tree", "car")
    given = read_ply(tmp_path / "b.ply", classes=Classes(("Baum", "Auto")))
    assert given.classes.names == ("Baum", "Auto")


@pytest.mark.parametrize(
    ("properties", "rows", "message"),
    [
        ("float x, float y, uchar label", "1 2 3\n", "has no z; its fields are x, y, label"),
        (XYZ, "1 2\n", "lines of 2 numbers for 3"),
        (XYZ, "1 2 3\n4 5\n", "not 3 numbers"),
        (XYZ, "1 2 cat\n", "not 3 numbers"),
        (XYZ, "1 2 inf\n", "NaN or infinite"),
        (XYZ + ", uchar label", "1 2 3 256\n", "no uint8"),
        (XYZ + ", uchar label", "1 2 3 -1\n", "no uint8"),
        (XYZ + ", int label", "1 2 3 -2\n", "between 0 and"),
        (XYZ + ", float label", "1 2 3 0.5\n", "not whole numbers"),
        (XYZ + ", int label", "1 2 3 123456\n", "too many to number"),
        (XYZ + ", float p_a", "1 2 3 -.5\n", "must not be negative"),
        (XYZ + ", float prob_1", "1 2 3 1\n", "count up from 0"),
        (XYZ + ", int red, int green, int blue", "1 2 3 0 0 256\n", "0 to 255"),
        (XYZ + ", float x", "1 2 3 4\n", "cannot be told apart"),
        (XYZ + ", list uchar int a", "1 2 3 0\n", "lists in or before"),
        (XYZ + ", quad q", "1 2 3 4\n", "makes no sense"),
    ],
)
def test_ply_says_what_is_wrong(properties: str, rows: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        read_ply(ascii_ply(tmp_path / "wrong.ply", properties, rows))
    assert "wrong.ply" in str(caught.value)


@pytest.mark.parametrize(
    "header",
    [
        "",
        "plywood\n",
        "ply\nend_header\n",
        "ply\nformat ascii 1.0\nend_header\n",
        "ply\nformat ascii 2.0\nend_header\n",
        "ply\nformat ascii 1.0\nformat ascii 1.0\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex -1\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n",
        "ply\nformat ascii 1.0\nproperty float x\nend_header\n",
        "ply\nformat ascii 1.0\n" + "comment " + "x" * 100_000 + "\nend_header\n",
    ],
)
def test_ply_headers_that_are_refused(header: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError):
        read_ply(ply(tmp_path / "a.ply", header))


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("element", ["vertex", "other"])
def test_ply_that_declares_more_than_it_has(form: str, element: str, tmp_path: Path) -> None:
    fields = "property double x\nproperty double y\nproperty double z\n"
    header = f"ply\nformat {form} 1.0\nelement {element} 1000000000000000000000\n{fields}"
    with pytest.raises(FileFormatError):
        read_ply(ply(tmp_path / "a.ply", header + f"element vertex 1\n{fields}end_header\n", b"1 2 3\n" * 50))


@pytest.mark.parametrize(
    "comment",
    ["class 0 1 2 3", "class zero 1 2 3 wall", "class 1 1 2 3 wall", "class 0 1 2 300 wall", "class 0 1"],
)
def test_ply_class_comments_that_are_refused(comment: str, tmp_path: Path) -> None:
    path = ascii_ply(tmp_path / "a.ply", XYZ, "1 2 3\n")
    path.write_bytes(path.read_bytes().replace(b"element", f"comment semgp {comment}\nelement".encode()))
    with pytest.raises(FileFormatError, match="class comments"):
        read_ply(path)


def test_ply_comments_of_others_are_passed_over(tmp_path: Path) -> None:
    path = ascii_ply(tmp_path / "a.ply", XYZ, "1 2 3\n")
    path.write_bytes(path.read_bytes().replace(b"element", b"comment class labels by hand\nelement"))
    assert len(read_ply(path)) == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"colours": np.zeros((3, 3))}, "uint8"),
        ({"colours": np.zeros((2, 3), np.uint8)}, "shape"),
        ({"label": [1, 2]}, "shape"),
        ({"label": [2**31, 0, 0]}, "32 bits"),
        ({"label": ["a", "b", "c"]}, "numbers"),
        ({"two words": [1, 2, 3]}, "cannot name"),
        ({"x": [1, 2, 3]}, "two fields .* x"),
        ({"probability": np.ones((3, 2))}, "needs classes"),
        ({"probability": np.ones((3, 2)), "classes": CLASSES}, "shape"),
        ({"probability": np.ones((3, 2)), "classes": Classes(("a b", "a_b"))}, "two fields .* p_a_b"),
        ({"classes": Classes(("a\nb",))}, "cannot hold"),
        ({"classes": Classes(("",))}, "cannot hold"),
    ],
)
def test_write_ply_refuses_and_leaves_nothing(options: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        write_ply(tmp_path / "a.ply", POINTS, **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("points", [[[1, 2]], [[np.nan, 0, 0]], [1, 2, 3]])
def test_write_ply_refuses_points(points: list[Any], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="points"):
        write_ply(tmp_path / "a.ply", points)


# ---------------------------------------------------------------- PCD


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


# ---------------------------------------------------------------- npz


@tmp_path_is_fine
@given(n=st.integers(0, 15), soft=st.booleans(), rich=st.booleans(), seed=st.integers(0, 2**32 - 1))
def test_npz_round_trip(n: int, soft: bool, rich: bool, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    extras: dict[str, Any] = {}
    if rich:
        extras = {
            "colours": rng.integers(0, 256, (n, 3), np.uint8),
            "features": rng.normal(size=(n, 2)).astype(np.float32),
            "feature_names": ("intensity", "height above ground"),
            "T_world_sensor": np.array([[0, -1, 0, 5e6], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]]),
            "confidence": rng.random(n, np.float32),
            "covariances": np.tile(np.diag([1e-4, 1e-4, 4e-4]), (n, 1, 1)),
            "pose_covariance": np.diag([1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6]),
            "stamp": 1_700_000_000.123456,
            "pixels": rng.integers(0, 100, (n, 2), np.int32),
            "image_shape": (100, 100),
        }
    labels = {"weights": rng.random((n, 3), np.float32)} if soft else {"labels": rng.integers(-1, 3, n, np.int32)}
    cloud = LabelledCloud(rng.normal(scale=1e6, size=(n, 3)), CLASSES, **labels, **extras)
    write_npz(tmp_path / "a.npz", cloud, entropy=np.ones(n))
    again = read(tmp_path / "a.npz")
    parts = ("points", "labels", "weights", "colours", "features", "T_world_sensor", "pixels")
    for field in (*parts, "confidence", "covariances", "pose_covariance"):
        expected, found = getattr(cloud, field), getattr(again, field)
        assert (expected is None) == (found is None)
        if expected is not None:
            np.testing.assert_array_equal(found, expected)
            assert found.dtype == expected.dtype
    assert again.classes == CLASSES
    assert (again.feature_names, again.image_shape) == (cloud.feature_names, cloud.image_shape)
    assert again.stamp == cloud.stamp


def test_npz_needs_points_only(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", points=POINTS.T.copy().T, labels=[0, 4, -1])
    cloud = read_npz(tmp_path / "a.npz")
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert len(cloud.classes) == 5
    cloud.points[0] = 0
    np.savez(tmp_path / "b.npz", points=POINTS, weights=np.ones((3, 7)))
    assert len(read_npz(tmp_path / "b.npz").classes) == 7
    assert read_npz(tmp_path / "a.npz", classes=Classes.numbered(9)).classes.names[8] == "class 8"


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"xyz": POINTS}, "has no array 'points'"),
        ({"points": POINTS[:, :2]}, r"shape \(N, 3\)"),
        ({"points": POINTS * np.nan}, "NaN"),
        ({"points": np.array([["a", "b", "c"]])}, "points of the wrong type"),
        ({"points": POINTS, "labels": [0.5, 0, 0]}, "labels of the wrong type"),
        ({"points": POINTS, "labels": [0, 1]}, "labels must have shape"),
        ({"points": POINTS, "labels": [0, 1, 2**40]}, "too many to number"),
        ({"points": POINTS, "labels": [0, 1, 2], "names": ["a", "b"]}, "labels go from 0 to 2"),
        ({"points": POINTS, "names": ["a", "a"]}, "class names must differ"),
        ({"points": POINTS, "names": ["a"], "palette": np.zeros((1, 4), np.uint8)}, "class colour"),
        ({"points": POINTS, "names": ["a"], "palette": np.zeros(1, np.uint8)}, "names of shape"),
        ({"points": POINTS, "names": [["a", "b"]]}, "names of shape"),
        ({"points": POINTS, "weights": np.full((3, 2), 1e300)}, "weights has NaN or infinite"),
        ({"points": POINTS, "image_shape": [1, 2, 3]}, "image_shape"),
        ({"points": POINTS, "stamp": [1.0, 2.0]}, "stamp must be one number"),
        ({"points": POINTS, "stamp": np.nan}, "stamp must be a time"),
        ({"points": POINTS, "confidence": [0.5, 2, 1]}, "between 0"),
        ({"points": POINTS, "covariances": np.full((3, 3, 3), -1.0)}, "eigenvalues"),
        ({"points": POINTS, "pose_covariance": np.eye(6)}, "needs T_world_sensor"),
        ({"points": POINTS, "T_world_sensor": np.ones((4, 4))}, "rigid"),
        ({"points": np.array([[{}, 1, 2]], dtype=object)}, "Python objects"),
    ],
)
def test_npz_says_what_is_wrong(arrays: dict[str, Any], message: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "wrong.npz", **arrays)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_npz(tmp_path / "wrong.npz")
    assert "wrong.npz" in str(caught.value)


def rezip(path: Path, member: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("points.npy", member)
    return path


def test_npz_headers_that_lie(tmp_path: Path) -> None:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**15, 3)})
    with pytest.raises(FileFormatError, match="has 24 bytes"):
        read_npz(rezip(tmp_path / "a.npz", header.getvalue() + bytes(24)))


def test_npz_with_flipped_array_headers(tmp_path: Path) -> None:
    """The checksum of a zip file guards against chance only, so damage the array before it is zipped."""
    buffer = io.BytesIO()
    np.save(buffer, POINTS)
    whole = np.frombuffer(buffer.getvalue(), np.uint8)
    rng = np.random.default_rng(0)
    alphabet = np.frombuffer(b"()[]{}<>,:'-0123456789LOfiUVb|#\\\n\t \x00\xff", np.uint8)
    for _ in range(400):
        damaged = whole.copy()
        damaged[rng.integers(0, 128, 2)] = rng.choice(alphabet, 2)
        try:
            cloud = read_npz(rezip(tmp_path / "a.npz", damaged.tobytes()))
        except FileFormatError:
            continue
        assert np.isfinite(cloud.points).all()


def test_write_npz_refuses(tmp_path: Path) -> None:
    cloud = LabelledCloud(POINTS, CLASSES)
    with pytest.raises(InputError, match="labels of the file are the cloud's"):
        write_npz(tmp_path / "a.npz", cloud, labels=[1, 2, 3])
    with pytest.raises(InputError, match="Python objects"):
        write_npz(tmp_path / "a.npz", cloud, thing=np.array([{}], dtype=object))
    assert list(tmp_path.iterdir()) == []
