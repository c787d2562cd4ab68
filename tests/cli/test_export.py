"""`semgp export`: maps opened again by the tools of others."""

from pathlib import Path

import numpy as np
import pytest

from semgp.maps.files import load_map
from semgp.maps.gp import GPSemanticMap
from semgp.maps.octree import to_octomap
from semgp.octomap import SemanticOctoMap
from semgp.readers import read
from tests.cli.test_commands import run


@pytest.fixture(scope="module")
def maps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with maps of one scan: gp.semgp with free space, plain.semgp without, octomap.semgp, knn.semgp."""
    from semgp.classes import Classes
    from semgp.cloud import LabelledCloud
    from semgp.writers import write_npz

    folder = tmp_path_factory.mktemp("maps")
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(0, 2, (300, 2)), np.zeros(300)])
    wall = np.column_stack([rng.uniform(0, 2, 300), np.full(300, 2.0), rng.uniform(0, 2, 300)])
    pose = np.eye(4)
    pose[:3, 3] = (1, -1, 1.2)
    labels = np.repeat([0, 1], 300)
    classes = Classes(("floor", "wall"), ((200, 10, 20), (30, 220, 40)))
    write_npz(folder / "scan.npz", LabelledCloud(np.vstack([floor, wall]), classes, labels, T_world_sensor=pose))
    build = ("build", folder / "scan.npz", "--quiet", "--resolution", "0.1", "--out")
    assert run(*build, folder / "gp.semgp", "--free-space") == 0
    assert run(*build, folder / "plain.semgp") == 0
    for kind in ("octomap", "knn"):
        assert run(*build, folder / f"{kind}.semgp", "--kind", kind) == 0
    return folder


@pytest.mark.parametrize("suffix", [".ply", ".npz", ".pcd", ".las", ".laz"])
@pytest.mark.parametrize("kind", ["gp", "octomap"])
def test_points(kind: str, suffix: str, maps: Path, tmp_path: Path) -> None:
    out = tmp_path / f"points{suffix}"
    assert run("export", maps / f"{kind}.semgp", "--out", out, "--quiet") == 0
    cloud = read(out)
    assert len(cloud) > 200
    assert cloud.classes.names == ("floor", "wall")
    on_floor = (cloud.points[:, 2] < 0.1) & (cloud.points[:, 1] < 1.7)
    assert (cloud.hard_labels[on_floor] == 0).mean() > 0.95


def test_resolution_of_points(maps: Path, tmp_path: Path) -> None:
    out = tmp_path / "points.ply"
    assert run("export", maps / "knn.semgp", "--resolution", "0.5", "--out", out, "--quiet") == 0
    assert 20 < len(read(out)) < 80


@pytest.mark.parametrize("kind", ["gp", "octomap"])
@pytest.mark.parametrize("suffix", [".bt", ".ot"])
def test_octomap_by_octomap(kind: str, suffix: str, maps: Path, tmp_path: Path) -> None:
    octomap = pytest.importorskip("octomap", reason="octomap-python reads the trees in this test")
    out = tmp_path / f"map{suffix}"
    assert run("export", maps / f"{kind}.semgp", "--out", out, "--quiet") == 0
    tree = octomap.OcTree(0.1)
    if suffix == ".bt":
        assert tree.readBinary(str(out).encode())
    else:
        tree = octomap.ColorOcTree.read(str(out).encode())
    semantic_map = load_map(maps / f"{kind}.semgp")
    assert isinstance(semantic_map, GPSemanticMap | SemanticOctoMap)
    assert tree.getResolution() == pytest.approx(semantic_map.resolution)
    mine = to_octomap(semantic_map) if isinstance(semantic_map, GPSemanticMap) else semantic_map
    for wanted, positions in ((True, mine.occupied_positions), (False, mine.free_positions)):
        rng = np.random.default_rng(0)
        some = positions[rng.choice(len(positions), 200)]
        assert all(tree.isNodeOccupied(tree.search(p)) == wanted for p in some)


def test_a_gp_map_fills_the_space_that_rays_passed(maps: Path) -> None:
    semantic_map = load_map(maps / "gp.semgp")
    assert isinstance(semantic_map, GPSemanticMap)
    octomap = to_octomap(semantic_map)
    scan = read(maps / "scan.npz")
    cast = SemanticOctoMap(scan.classes, 0.1)
    cast.update(scan)
    assert (octomap.occupancy(cast.free_positions).state == 0).mean() > 0.9
    assert (octomap.occupancy(cast.occupied_positions).state == 1).mean() > 0.95
    answer = octomap.query(cast.occupied_positions)
    np.testing.assert_allclose(answer.probability.sum(axis=1), 1)
    expected = semantic_map.query(octomap.positions)
    np.testing.assert_allclose(octomap.query(octomap.positions).probability, expected.probability, atol=1e-6)


def test_colours_of_classes(maps: Path, tmp_path: Path) -> None:
    out = tmp_path / "map.ot"
    assert run("export", maps / "gp.semgp", "--resolution", "0.2", "--out", out, "--quiet") == 0
    again = SemanticOctoMap.read(out, load_map(maps / "gp.semgp").classes)
    assert again.resolution == 0.2
    colours, known = again.query_colours(again.occupied_positions)
    assert known.mean() > 0.9
    assert {tuple(c) for c in colours[known].tolist()} == {(200, 10, 20), (30, 220, 40)}


def test_utm_gets_an_origin_of_its_own(maps: Path) -> None:
    semantic_map = load_map(maps / "gp.semgp")
    assert isinstance(semantic_map, GPSemanticMap)
    scan = read(maps / "scan.npz")
    shift = np.array([691_234.0, 5_334_567.0, 517.0])
    far = GPSemanticMap(scan.classes, semantic_map.model, free=semantic_map.free)
    pose = np.array(scan.T_world_sensor)
    pose[:3, 3] += shift
    far.update(type(scan)(scan.points + shift, scan.classes, scan.labels, T_world_sensor=pose))
    octomap = to_octomap(far)
    assert np.abs(octomap.origin - shift).max() < 5
    assert np.abs(octomap.occupied_positions - shift).max() < 5


@pytest.mark.parametrize(
    ("message", "arguments"),
    [
        ("build it with semgp build --free-space", ("plain.semgp", "--out", "{out}.bt")),
        ("has no resolution of its own: give --resolution", ("knn.semgp", "--out", "{out}.ply")),
        ("is written as it is", ("octomap.semgp", "--resolution", "0.5", "--out", "{out}.bt")),
        ("written as .ply, .npz, .pcd, .las, .laz, .csv, .bt, .ot", ("gp.semgp", "--out", "{out}.doc")),
        ("positive number of metres", ("gp.semgp", "--resolution", "0", "--out", "{out}.ply")),
        ("positive", ("gp.semgp", "--resolution", "-1", "--out", "{out}.bt")),
        ("reach of a tree", ("gp.semgp", "--resolution", "0.00001", "--out", "{out}.bt")),
        ("no such file", ("absent.semgp", "--out", "{out}.ply")),
    ],
)
def test_bad_input(
    message: str, arguments: tuple[str, ...], maps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, *rest = arguments
    assert run("export", maps / name, *(a.format(out=tmp_path / "out") for a in rest)) == 2
    captured = capsys.readouterr()
    assert message in " ".join((captured.err + captured.out).split())
    assert list(tmp_path.iterdir()) == []
