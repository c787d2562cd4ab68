"""PLY files: what is written is read again, and so are those of others."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from semgp.classes import MISSING, Classes
from semgp.errors import FileFormatError
from semgp.readers import read, read_ply
from semgp.writers import write_ply
from tests.readers.ply_files import XYZ, ascii_ply, ply

CLASSES = Classes(("floor mat", "wall", "überall"), ((1, 2, 3), (4, 5, 6), (250, 251, 252)))
POINTS = np.array([[0.5, 1.5, -2.5], [1, 2, 3], [-4, 5, 6.25]])

tmp_path_is_fine = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)

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


def test_ply_comments_of_others_are_passed_over(tmp_path: Path) -> None:
    path = ascii_ply(tmp_path / "a.ply", XYZ, "1 2 3\n")
    path.write_bytes(path.read_bytes().replace(b"element", b"comment class labels by hand\nelement"))
    assert len(read_ply(path)) == 1
