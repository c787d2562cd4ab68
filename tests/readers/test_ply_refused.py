"""PLY files, and arrays for them, that are wrong: what is wrong is said."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.errors import FileFormatError, InputError
from semgp.readers import read_ply
from semgp.writers import write_ply
from tests.readers.ply_files import XYZ, ascii_ply, ply

CLASSES = Classes(("floor mat", "wall", "überall"), ((1, 2, 3), (4, 5, 6), (250, 251, 252)))
POINTS = np.array([[0.5, 1.5, -2.5], [1, 2, 3], [-4, 5, 6.25]])


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
