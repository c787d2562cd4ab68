"""E57 files: scans with their poses."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from scipy.spatial.transform import Rotation

from semgp.errors import FileFormatError, MissingExtraError
from semgp.readers import open_scans, read, read_e57
from tests.point_samples import Damage, damages, sample_e57, survives, write_e57

pytest.importorskip("pye57", reason="E57 files need the extra e57")

quick = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40, deadline=None)

XYZ = ("cartesianX", "cartesianY", "cartesianZ")
RGB = ("colorRed", "colorGreen", "colorBlue")


def test_scans_with_their_poses(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    turn = Rotation.random(random_state=1)
    x, y, z, w = turn.as_quat()
    local = rng.normal(size=(30, 3))
    columns = {**dict(zip(XYZ, local.T.copy())), **{name: np.full(30, v) for name, v in zip(RGB, (0.0, 128, 255))}}
    path = write_e57(tmp_path / "a.e57", [columns, columns], [(w, x, y, z, 691_234.5, 5_334_567.8, 3), None])
    first, second = open_scans(path)
    np.testing.assert_allclose(
        first.points, turn.apply(local) + np.array([691_234.5, 5_334_567.8, 3]), atol=1e-6, rtol=0
    )
    assert first.T_world_sensor is not None
    np.testing.assert_allclose(first.T_world_sensor[:3, :3], turn.as_matrix(), atol=1e-12)
    np.testing.assert_array_equal(first.origin, [691_234.5, 5_334_567.8, 3])
    np.testing.assert_allclose(second.points, local)
    assert second.T_world_sensor is None
    assert first.labels is None
    np.testing.assert_array_equal(first.colours, np.tile([0, 128, 255], (30, 1)))


def test_spherical_coordinates_invalid_points_and_labels(tmp_path: Path) -> None:
    columns = {
        "sphericalRange": np.array([2.0, 2, 2]),
        "sphericalAzimuth": np.array([0, np.pi / 2, 0]),
        "sphericalElevation": np.array([0, 0, np.pi / 2]),
        "sphericalInvalidState": np.array([0.0, 0, 1]),
        "intensity": np.array([0.25, 0.5, 1]),
        "ext:classification": np.array([3.0, -1, 0]),
    }
    cloud = read(write_e57(tmp_path / "a.e57", [columns], [None]), features=("intensity",))
    np.testing.assert_allclose(cloud.points, [[2, 0, 0], [0, 2, 0]], atol=1e-12)
    np.testing.assert_array_equal(cloud.labels, [3, -1])
    np.testing.assert_array_equal(cloud.features, [[0.25], [0.5]])


def test_many_points_come_in_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("semgp.readers.e57.POINTS_AT_ONCE", 7)
    columns = {name: np.arange(50.0) for name in XYZ}
    np.testing.assert_array_equal(
        read(write_e57(tmp_path / "a.e57", [columns], [None])).points, np.tile(np.arange(50.0), (3, 1)).T
    )


def test_fields_that_are_missing(tmp_path: Path) -> None:
    path = write_e57(tmp_path / "a.e57", [{name: np.zeros(2) for name in (*XYZ, "intensity")}], [None])
    with pytest.raises(FileFormatError, match=r"has no semantic; its fields are cartesianX, .*intensity"):
        read_e57(path, field="semantic")
    path = write_e57(tmp_path / "b.e57", [{"intensity": np.zeros(2)}], [None])
    with pytest.raises(FileFormatError, match="has no coordinates; its fields are intensity"):
        read(path)


def test_more_points_than_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = sample_e57(tmp_path)
    monkeypatch.setattr("semgp.readers.e57.MOST_PER_BYTE", 0)
    with pytest.raises(FileFormatError, match="cannot hold the 20 points"):
        read_e57(path)


def test_without_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = sample_e57(tmp_path)
    monkeypatch.setitem(sys.modules, "pye57", None)
    with pytest.raises(MissingExtraError, match=r"semgp\[e57\]"):
        read(path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return sample_e57(tmp_path_factory.mktemp("e57")).read_bytes()


@quick
@given(damage=damages)
def test_damaged(damage: Damage, whole: bytes, tmp_path: Path) -> None:
    survives(tmp_path / "a.e57", whole, damage)


@quick
@given(damage=damages)
def test_damaged_with_checksums_that_fit(damage: Damage, whole: bytes, tmp_path: Path) -> None:
    """Checksums guard against chance, not against somebody who means it."""
    damaged = bytearray(whole)
    for where, value in damage[1]:
        damaged[int(where * len(whole))] = value
    for page in range(0, len(whole), 1024):
        damaged[page + 1020 : page + 1024] = struct.pack(">I", crc32c(damaged[page : page + 1020]))
    survives(tmp_path / "a.e57", bytes(damaged), (1.0, []))


def crc32c(data: bytes | bytearray) -> int:
    """Castagnoli's checksum, bit by bit."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def test_the_checksum_is_that_of_the_format(whole: bytes) -> None:
    assert whole[1020:1024] == struct.pack(">I", crc32c(whole[:1020]))
