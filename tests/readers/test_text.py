"""Lines of text: with and without header, and what is said of those that are wrong."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from semgp.errors import FileFormatError
from semgp.readers import read, read_text
from tests.point_samples import Damage, damages, sample_text, survives

XYZ = [[1, 2, 3], [4, 5, 6]]


def text(folder: Path, content: str) -> Path:
    (folder / "a.txt").write_text(content)
    return folder / "a.txt"


@pytest.mark.parametrize(
    "content",
    [
        "1 2 3\n4 5 6\n",
        "1\t2\t3\n\n4\t5\t6",
        "1,2,3\r\n4,5,6\r\n",
        "1; 2; 3\n4; 5; 6\n",
        "x y z\n1 2 3\n4 5 6\n",
        '"x","y","z"\n1,2,3\n4,5,6\n',
        "//X,Y,Z\n1,2,3\n4,5,6\n",
        "# scanned on a Monday\n# X Y Z\n1 2 3\n4 5 6\n",
        "# scanned on a Monday\n1 2 3\n4 5 6\n",
        "\ufeffx,y,z\n1,2,3\n4,5,6\n",
        "x y z\n1 2 3\nnan nan nan\n4 5 6\n",
        "z y x\n3 2 1\n6 5 4\n",
    ],
)
def test_positions(content: str, tmp_path: Path) -> None:
    cloud = read(text(tmp_path, content))
    np.testing.assert_array_equal(cloud.points, XYZ)
    assert cloud.labels is None


def test_columns_by_their_names(tmp_path: Path) -> None:
    content = "x,y,z,r,g,b,label,intensity\n1,2,3,0,128,255,4,0.5\n4,5,6,1,2,3,-1,1\n"
    cloud = read(text(tmp_path, content), features=("intensity",))
    np.testing.assert_array_equal(cloud.colours, [[0, 128, 255], [1, 2, 3]])
    np.testing.assert_array_equal(cloud.labels, [4, -1])
    np.testing.assert_array_equal(cloud.features, [[0.5], [1]])


def test_columns_without_names(tmp_path: Path) -> None:
    np.testing.assert_array_equal(read(text(tmp_path, "1 2 3 7\n")).labels, [7])
    np.testing.assert_array_equal(read(text(tmp_path, "1 2 3 7 8 9\n")).colours, [[7, 8, 9]])
    path = text(tmp_path, "1 2 3 0.5 2\n")
    with pytest.raises(FileFormatError, match="has 5 columns, but no header"):
        read(path)
    np.testing.assert_array_equal(read(path, columns=("x", "y", "z", "intensity", "label")).labels, [2])


def test_another_column_holds_the_labels(tmp_path: Path) -> None:
    path = text(tmp_path, "x y z Semantic\n1 2 3 5\n")
    np.testing.assert_array_equal(read_text(path, field="semantic").labels, [5])
    with pytest.raises(FileFormatError, match="has no kind; its fields are x, y, z, Semantic"):
        read_text(path, field="kind")


def test_utm_keeps_its_millimetres(tmp_path: Path) -> None:
    path = text(tmp_path, "691234.567,5334567.891,517.123\n")
    np.testing.assert_array_equal(read(path).points, [[691234.567, 5334567.891, 517.123]])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "no line of numbers"),
        ("x y z\n", "no line of numbers"),
        ("x y z\n1 2 3\n\n1 2\n", r"line 4 is not 3 numbers: '1 2'"),
        ("1 2 3\n1 2 cat\n", r"line 2 is not 3 numbers: '1 2 cat'"),
        ("1,2,3\n1 2 3\n", r"line 2 is not 3 numbers: '1 2 3'"),
        ("1 2 3\n1 2 3 4\n", r"line 2 is not 3 numbers"),
        ("x y\n1 2\n", "has no z; its fields are x, y"),
        ("x y z w\n1 2 3\n", "has 3 columns, for the names x, y, z, w"),
        ("x y x\n1 2 3\n", "has 3 columns, for the names x, y, x"),
        ("1 2 3 0.5\n", "labels that are not whole numbers"),
        ("1 2 inf\n", "NaN or infinite"),
        ("1\n2\n", "has 1 columns, but no header"),
    ],
)
def test_what_is_wrong_is_said(content: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        read(text(tmp_path, content))
    assert "a.txt" in str(caught.value)


def test_what_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_bytes(b"1 2 3\n\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="is no text"):
        read(tmp_path / "a.txt")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
@given(damage=damages)
def test_damaged(damage: Damage, tmp_path: Path) -> None:
    survives(tmp_path / "a.csv", sample_text(tmp_path).read_bytes(), damage)
