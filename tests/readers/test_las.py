"""LAS and LAZ files: read as laspy wrote them, and refused where damaged."""

import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings

from semgp.asprs import ASPRS
from semgp.classes import MISSING, Classes
from semgp.errors import FileFormatError, MissingExtraError
from semgp.readers import read, read_las
from semgp.writers import write_las
from tests.point_samples import Damage, damages, sample_las, sample_laz, survives

laspy = pytest.importorskip("laspy", reason="LAS files need the extra las")

UTM = np.array(
    [[691_234.5671, 5_334_567.8912, 517.1234], [691_235.0, 5_334_000.0001, 520.0], [691_000, 5_335_000, 0]]
)

quick = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)


def las_file(path: Path, codes: list[int], version: str = "1.4", form: int = 6, **fields: Any) -> Path:
    header = laspy.LasHeader(version=version, point_format=form)
    header.scales, header.offsets = np.full(3, 1e-4), UTM[0]
    las = laspy.LasData(header)
    las.x, las.y, las.z = UTM.T
    las.classification = codes
    for name, values in fields.items():
        las[name] = values
    las.write(path)
    return path


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
@pytest.mark.parametrize(("version", "form"), [("1.2", 3), ("1.4", 7)])
def test_standard_classes_and_utm_millimetres(name: str, version: str, form: int, tmp_path: Path) -> None:
    path = las_file(tmp_path / name, [2, 6, 1], version, form, intensity=[1, 2, 65535], red=[0, 257, 65535])
    cloud = read(path, features=("intensity",))
    np.testing.assert_allclose(cloud.points, UTM, atol=1e-4, rtol=0)
    assert cloud.classes == ASPRS
    assert [cloud.classes.names[c] for c in cloud.hard_labels[:2]] == ["ground", "building"]
    assert cloud.hard_labels[2] == MISSING
    np.testing.assert_array_equal(cloud.features, [[1], [2], [65535]])
    np.testing.assert_array_equal(cloud.colours, [[0, 0, 0], [1, 0, 0], [255, 0, 0]])


def test_colours_of_eight_bits_stay(tmp_path: Path) -> None:
    cloud = read(las_file(tmp_path / "a.las", [2, 2, 2], form=7, red=[0, 7, 255]))
    np.testing.assert_array_equal(cloud.colours, [[0, 0, 0], [7, 0, 0], [255, 0, 0]])


def test_no_colours_but_black_are_none(tmp_path: Path) -> None:
    assert read(las_file(tmp_path / "a.las", [2, 2, 2], form=7)).colours is None


def test_withheld_points_are_left_out(tmp_path: Path) -> None:
    assert len(read(las_file(tmp_path / "a.las", [2, 2, 2], withheld=[0, 1, 0]))) == 2


def test_another_field_holds_the_labels(tmp_path: Path) -> None:
    path = las_file(tmp_path / "a.las", [2, 6, 1], user_data=[0, 2, 1])
    cloud = read_las(path, field="user_data")
    assert len(cloud.classes) == 3
    np.testing.assert_array_equal(cloud.labels, [0, 2, 1])
    with pytest.raises(FileFormatError, match=r"has no semantic; its fields are x, y, z, intensity, .*user_data"):
        read_las(path, field="semantic")


def test_classification_goes_before_a_field_called_label(tmp_path: Path) -> None:
    write_las(tmp_path / "a.las", UTM, classes=ASPRS, label=[0, 4, MISSING], **{"class": [7, 8, 9]})
    np.testing.assert_array_equal(read(tmp_path / "a.las").labels, [0, 4, MISSING])
    np.testing.assert_array_equal(read(tmp_path / "a.las", field="class").labels, [7, 8, 9])


def test_codes_of_the_user(tmp_path: Path) -> None:
    path = las_file(tmp_path / "a.las", [2, 70, 200])
    with pytest.raises(FileFormatError, match="classes 70, 200, which the ASPRS leaves to the user"):
        read(path)
    np.testing.assert_array_equal(read(path, classes=Classes.numbered(256)).labels, [2, 70, 200])
    with pytest.raises(FileFormatError, match="labels go from"):
        read(path, classes=Classes(("tree", "car")))


def test_reserved_codes_say_nothing(tmp_path: Path) -> None:
    np.testing.assert_array_equal(read(las_file(tmp_path / "a.las", [0, 8, 12])).hard_labels, [MISSING] * 3)


@pytest.mark.parametrize("module", ["laspy", "lazrs"])
def test_without_the_extra(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = sample_las(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=r"semgp\[las\]"):
        read(path)


@quick
@given(damage=damages)
@example(damage=(1.0, [(0.0, 0)]))
def test_damaged_las(damage: Damage, tmp_path: Path) -> None:
    whole = sample_las(tmp_path).read_bytes()
    survives(tmp_path / "a.las", whole, damage)


@quick
@given(damage=damages)
def test_damaged_laz(damage: Damage, tmp_path: Path) -> None:
    whole = sample_laz(tmp_path).read_bytes()
    survives(tmp_path / "a.laz", whole, damage)


@pytest.mark.parametrize(
    ("offset", "form", "value", "message"),
    [
        (96, "<I", 2**32 - 1, "records before byte"),
        (100, "<I", 2**32 - 1, "records before byte"),
        (247, "<Q", 10**15, "is truncated or its header lies: 1000000000000000 points"),
        (0, "<I", 0, "does not begin with LASF"),
    ],
)
def test_headers_that_lie(offset: int, form: str, value: int, message: str, tmp_path: Path) -> None:
    path = sample_las(tmp_path)
    raw = bytearray(path.read_bytes())
    struct.pack_into(form, raw, offset, value)
    path.write_bytes(raw)
    with pytest.raises(FileFormatError, match=message):
        read(path)


def test_compressed_files_that_lie(tmp_path: Path) -> None:
    """Each of these made the decompressor ask for gigabytes, and end the process."""
    path = sample_laz(tmp_path)
    whole = path.read_bytes()
    start = struct.unpack_from("<I", whole, 96)[0]
    table = struct.unpack_from("<q", whole, start)[0]
    items = whole.index(b"laszip encoded") - 2 + 54 + 32  # user and record number begin the record's 54 bytes
    for offset, form, value, message in [
        (table + 4, "<I", 2**31, "table of chunks"),
        (start, "<q", 2**40, "table of chunks"),
        (start, "<q", -1, "table of chunks|truncated|damaged"),
        (247, "<Q", 10**12, "decompression bomb"),
        (items, "<H", 0, "do not fit its point format"),
        (items + 4, "<H", 60_000, "do not fit its point format"),
    ]:
        raw = bytearray(whole)
        struct.pack_into(form, raw, offset, value)
        path.write_bytes(raw)
        with pytest.raises(FileFormatError, match=message):
            read(path)
