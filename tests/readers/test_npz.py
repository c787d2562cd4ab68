"""npz files: what is written is read again, and what is wrong is said."""

import gc
import io
import sys
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.readers import read, read_npz
from semgp.readers.npz import read_npy
from semgp.writers import write_npz

CLASSES = Classes(("floor mat", "wall", "überall"), ((1, 2, 3), (4, 5, 6), (250, 251, 252)))
POINTS = np.array([[0.5, 1.5, -2.5], [1, 2, 3], [-4, 5, 6.25]])

tmp_path_is_fine = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)


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


@pytest.fixture
def hasty() -> Iterator[None]:
    """Let threads take turns as often as can be, and collect garbage all the time."""
    interval, thresholds = sys.getswitchinterval(), gc.get_threshold()
    sys.setswitchinterval(1e-6)
    gc.set_threshold(20)
    yield
    sys.setswitchinterval(interval)
    gc.set_threshold(*thresholds)


@pytest.mark.usefixtures("hasty")
def test_many_threads_read_at_once() -> None:
    class Garbage:
        """Collected only as a cycle, by code that lets other threads in."""

        def __init__(self) -> None:
            self.itself = self

        def __del__(self) -> None:
            sum(range(20))

    stream = io.BytesIO()
    np.save(stream, np.arange(12.0).reshape(3, 4))

    def read_often(_: int) -> int:
        for _ in range(3000):
            Garbage()
            whole = read_npy(stream.getvalue())
        return whole.size

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(read_often, range(8))) == 8 * [12]
