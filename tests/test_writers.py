"""What is written opens again elsewhere: laspy, trimesh, and a PCD parser of a few plain lines."""

import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.asprs import ASPRS, FIRST_USER_CODE
from semgp.classes import MISSING, Classes
from semgp.errors import InputError, MissingExtraError
from semgp.maps.points import POINT_WRITERS, write_prediction
from semgp.prediction import OccupancyPrediction, Prediction
from semgp.readers import read
from semgp.writers import atomic_write, write_csv, write_las, write_pcd

CLASSES = Classes(("floor mat", "wall", "überall"), ((1, 2, 3), (4, 5, 6), (250, 251, 252)))
POINTS = np.array([[0.5, 1.5, -2.5], [1, 2, 3], [-4, 5, 6.25]])
UTM = POINTS + np.array([691_234.5678, 5_334_567.8912, 517.1234])
P = np.array([[0.2, 0.3, 0.5], [1, 0, 0], [0.25, 0.5, 0.25]])


def prediction() -> Prediction:
    observed = np.array([True, True, False])
    occupancy = OccupancyPrediction(np.array([0.9, 0.1, 0.5]), np.array([True, True, False]))
    return Prediction(CLASSES, P, observed, np.zeros((3, 3)), np.arange(9.0).reshape(3, 3), occupancy)


def parse_pcd(path: Path) -> dict[str, list[Any]]:
    """Read a binary PCD file as the format's page has it, a number at a time."""
    header, _, body = path.read_bytes().partition(b"DATA binary\n")
    words = {line.split()[0]: line.split()[1:] for line in header.decode().splitlines() if line[0] != "#"}
    codes = {"F4": "f", "F8": "d", "U4": "I", "I4": "i"}
    row = struct.Struct("<" + "".join(codes[t + s] for t, s in zip(words["TYPE"], words["SIZE"], strict=True)))
    assert words["COUNT"] == ["1"] * len(words["FIELDS"])
    assert int(words["POINTS"][0]) == int(words["WIDTH"][0]) * int(words["HEIGHT"][0])
    rows = list(row.iter_unpack(body))
    assert len(rows) == int(words["POINTS"][0])
    return {name: [r[i] for r in rows] for i, name in enumerate(words["FIELDS"])}


def test_pcd_by_a_naive_parser(tmp_path: Path) -> None:
    colours = np.array([[1, 2, 3], [4, 5, 6], [250, 251, 252]], np.uint8)
    write_pcd(tmp_path / "a.pcd", POINTS, classes=CLASSES, colours=colours, probability=P, label=[2, 0, MISSING])
    found = parse_pcd(tmp_path / "a.pcd")
    assert list(found) == ["x", "y", "z", "rgb", "p_floor_mat", "p_wall", "p_überall", "label"]
    np.testing.assert_array_equal(np.transpose([found[a] for a in "xyz"]), POINTS)
    packed = [struct.unpack("<I", struct.pack("<f", v))[0] for v in found["rgb"]]
    assert packed == [0x010203, 0x040506, 0xFAFBFC]
    assert found["label"] == [2, 0, 2**32 - 1]
    np.testing.assert_allclose(
        np.transpose([found[f"p_{n}"] for n in ("floor_mat", "wall", "überall")]), P, atol=1e-7
    )


def test_pcd_is_read_again(tmp_path: Path) -> None:
    write_pcd(tmp_path / "a.pcd", UTM, classes=CLASSES, label=[2, 0, MISSING], entropy=[0.0, 0.5, 1])
    cloud = read(tmp_path / "a.pcd", features=("entropy",))
    np.testing.assert_array_equal(cloud.points, UTM)
    np.testing.assert_array_equal(cloud.labels, [2, 0, MISSING])
    assert cloud.classes == CLASSES
    assert parse_pcd(tmp_path / "a.pcd")["x"] == UTM[:, 0].tolist()


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_las_by_laspy(name: str, tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy", reason="LAS files need the extra las")
    colours = np.array([[1, 2, 3], [4, 5, 6], [250, 251, 255]], np.uint8)
    labels = [2, 0, MISSING]
    write_las(
        *(tmp_path / name, UTM),
        classes=CLASSES, colours=colours, probability=P, label=labels, entropy=[0, 0.5, 1], intensity=[1, 2,
        65535],
    )  # fmt: skip
    las = laspy.read(tmp_path / name)
    assert str(las.header.version) == "1.4"
    assert las.header.are_points_compressed == (name == "a.laz")
    np.testing.assert_allclose(np.transpose([las.x, las.y, las.z]), UTM, atol=0.6e-4, rtol=0)
    assert list(las.classification) == [FIRST_USER_CODE + 2, FIRST_USER_CODE, 1]
    np.testing.assert_array_equal(np.transpose([las.red, las.green, las.blue]), 257 * colours.astype(int))
    np.testing.assert_allclose(
        np.transpose([las[f"p_{n}"] for n in ("floor_mat", "wall", "überall")]), P, atol=1e-7
    )
    assert list(las["entropy"]) == [0, 0.5, 1]
    assert list(las.intensity) == [1, 2, 65535]
    lookup = las.header.vlrs.get("ClassificationLookupVlr")[0]
    assert lookup[FIRST_USER_CODE + 1] == "wall"


@pytest.mark.parametrize("soft", [False, True])
def test_las_is_read_again(soft: bool, tmp_path: Path) -> None:
    options: dict[str, Any] = {"probability": P} if soft else {}
    write_las(tmp_path / "a.las", UTM, classes=CLASSES, label=[2, 0, MISSING], **options)
    cloud = read(tmp_path / "a.las")
    assert cloud.classes == CLASSES
    np.testing.assert_array_equal(cloud.hard_labels, [2, 0, MISSING])
    assert (cloud.weights is not None) == soft
    assert read(tmp_path / "a.las", classes=Classes(("a", "b", "c"))).classes.names == ("a", "b", "c")


def test_las_takes_the_codes_of_the_asprs(tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy", reason="LAS files need the extra las")
    write_las(tmp_path / "a.las", POINTS, classes=Classes(("Building", "ground")), label=[0, 1, MISSING])
    assert list(laspy.read(tmp_path / "a.las").classification) == [6, 2, 1]
    np.testing.assert_array_equal(read(tmp_path / "a.las").labels, [0, 1, MISSING])
    write_las(tmp_path / "b.las", POINTS, classes=ASPRS, label=[4, 0, MISSING])
    assert list(laspy.read(tmp_path / "b.las").classification) == [6, 2, 1]


def test_las_of_a_continent_and_of_nothing(tmp_path: Path) -> None:
    wide = np.array([[-2e6, -1e6, 0], [3e6, 5e6, 4000]])
    write_las(tmp_path / "a.las", wide)
    np.testing.assert_allclose(read(tmp_path / "a.las").points, wide, atol=1e-2, rtol=0)
    write_las(tmp_path / "b.laz", np.empty((0, 3)))
    assert len(read(tmp_path / "b.laz")) == 0


def test_las_of_long_names(tmp_path: Path) -> None:
    classes = Classes(("a" * 60, "b"))
    write_las(tmp_path / "a.las", POINTS, classes=classes, probability=P[:, :2] + 0.25, label=[0, 1, 1])
    cloud = read(tmp_path / "a.las")
    assert cloud.classes.names == classes.names
    np.testing.assert_allclose(cloud.class_weights, P[:, :2] + 0.25)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"classes": Classes.numbered(193), "label": [0, 1, 2]}, "room for 192 classes"),
        ({"label": [0, 1]}, "labels must have shape"),
        ({"classes": CLASSES, "label": [0, 1, 3]}, "labels go from"),
        ({"probability": P}, "needs classes"),
        ({"colours": np.zeros((3, 3))}, "uint8"),
        ({"intensity": [0, 1, 65536]}, "intensity"),
        ({"intensity": [0, 1, 0.5]}, "intensity"),
        ({"return_number": [0, 1, 16]}, "return_number"),
        ({"classification": [1, 2, 3]}, "written from the points"),
        ({"n" * 33: [1, 2, 3]}, "32 bytes at most"),
        ({"classes": Classes(("a b", "a_b", "c")), "probability": P}, "two fields .* p_a_b"),
        ({"classes": Classes(("a" * 66_000, "b"))}, "too long"),
    ],
)
def test_write_las_refuses_and_leaves_nothing(options: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        write_las(tmp_path / "a.las", POINTS, **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", sorted(POINT_WRITERS.keys() - {".csv"}))
def test_a_prediction_in_every_format(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    write_prediction(path, UTM, prediction())
    if suffix == ".npz":
        with np.load(path) as arrays:
            assert {"label", "observed", "confidence", "entropy", "variance", "occupancy", "state"} <= set(arrays)
            np.testing.assert_array_equal(arrays["label"], [2, 0, MISSING])
        cloud = read(path)
    else:
        names = ("observed", "confidence", "entropy", "variance", "occupancy", "state")
        cloud = read(path, features=names)
        assert cloud.features is not None
        confidence_variance_state = np.array([[0.5, 2, 1], [1, 3, 0], [0.5, 7, -1]])
        np.testing.assert_allclose(cloud.features[:, [1, 3, 5]], confidence_variance_state, atol=1e-6)
        np.testing.assert_array_equal(cloud.hard_labels, [2, 0, MISSING])
    assert cloud.classes == CLASSES
    np.testing.assert_allclose(cloud.points, UTM, atol=1e-4, rtol=0)
    np.testing.assert_allclose(cloud.class_weights[:2], P[:2], atol=1e-6)
    assert cloud.colours is not None
    np.testing.assert_array_equal(cloud.colours[:2], [[250, 251, 252], [1, 2, 3]])


def test_ply_by_trimesh(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh", reason="trimesh reads PLY in this test")
    write_prediction(tmp_path / "a.ply", POINTS, prediction())
    loaded = trimesh.load(tmp_path / "a.ply")
    np.testing.assert_allclose(loaded.vertices, POINTS, atol=1e-6)
    data: NDArray[Any] = loaded.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(np.ravel(data["label"]), [2, 0, MISSING])
    np.testing.assert_allclose(np.ravel(data["p_wall"]), P[:, 1], atol=1e-7)


def test_predictions_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"written as \.ply, \.npz, \.pcd, \.las, \.laz"):
        write_prediction(tmp_path / "a.doc", POINTS, prediction())
    monkeypatch.setitem(sys.modules, "laspy", None)
    with pytest.raises(MissingExtraError, match=r"semgp\[las\]"):
        write_prediction(tmp_path / "a.laz", POINTS, prediction())
    assert list(tmp_path.iterdir()) == []


# ---------------------------------------------------------------- atomic writing


def test_atomic_write_replaces_whole(tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    path.write_text("old")
    with atomic_write(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
        assert (temporary.parent, temporary.suffix) == (tmp_path, ".npz")
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_atomic_write_keeps_the_old_file_after_an_error(tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    path.write_text("old")

    def write_half() -> None:
        with atomic_write(path) as temporary:
            temporary.write_text("half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        write_half()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_atomic_write_into_no_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"), atomic_write(tmp_path / "no" / "a.ply"):
        pass


def test_csv_is_read_again(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    points, classes = rng.normal(size=(40, 3)) * 1e5, Classes(("low wall", "sky, clear"))
    p = rng.dirichlet(np.ones(2), 40)
    colours = rng.integers(0, 255, (40, 3)).astype(np.uint8)
    label = p.argmax(axis=1)
    write_csv(
        tmp_path / "a.csv", points, classes=classes, colours=colours, probability=p, label=label, entropy=p[:, 0]
    )
    header, *rows = (tmp_path / "a.csv").read_text().splitlines()
    assert header == "x,y,z,red,green,blue,p_low_wall,p_sky__clear,label,entropy"
    table = np.array([[float(v) for v in row.split(",")] for row in rows])
    np.testing.assert_allclose(table[:, :3], points, atol=5.1e-5)
    np.testing.assert_allclose(table[:, 6:8], p, rtol=1e-5)
    np.testing.assert_array_equal(table[:, 8], label)
    np.testing.assert_array_equal(read(tmp_path / "a.csv").hard_labels, label)


def test_csv_refuses_what_no_writer_takes(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="finite"):
        write_csv(tmp_path / "a.csv", [[0, 0, np.nan]])
    with pytest.raises(InputError, match="needs classes"):
        write_csv(tmp_path / "a.csv", [[0, 0, 0]], probability=[[1.0]])
    assert not (tmp_path / "a.csv").exists()
