"""`semgp render`, and the pictures and meshes of `slice` and `surface`, as a user types them."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.test_commands import run

SMALL = ("--size", "160", "120", "--resolution", "0.1")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small map with free space of a floor, a wall and a table."""
    from semgp.cloud import LabelledCloud
    from semgp.maps.files import save_map
    from semgp.maps.free_space import FreeSpace
    from semgp.maps.gp import GPSemanticMap
    from tests.conftest import THREE

    rng, T = np.random.default_rng(0), np.eye(4)
    floor = np.column_stack([rng.uniform(0, 2, (900, 2)), np.zeros(900)])
    wall = np.column_stack([rng.uniform(0, 2, 600), np.full(600, 2.0), rng.uniform(0, 2, 600)])
    table = np.column_stack([rng.uniform(0.5, 1.5, (300, 2)), np.full(300, 0.8)])
    T[:3, 3] = (1.0, -1.0, 1.6)
    labels = np.repeat([0, 1, 2], [900, 600, 300])
    gp_map = GPSemanticMap(THREE, free=FreeSpace())
    gp_map.update(LabelledCloud(np.vstack([floor, wall, table]), THREE, labels, T_world_sensor=T))
    path = tmp_path_factory.mktemp("map") / "map.semgp"
    save_map(gp_map, path)
    return path


def test_a_still_picture(built: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "map.png"
    assert run("render", built, "--out", out, *SMALL, "--no-keys", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["out"] == str(out)
    assert facts["points"] > 400
    with Image.open(out) as picture:
        assert picture.size == (160, 120)
        assert len(picture.convert("RGB").getcolors(maxcolors=20000) or ()) > 50


def test_panels_with_scans_keys_and_a_title(built: Path, scan: Path, tmp_path: Path) -> None:
    out, looks = tmp_path / "map.png", ("--top", "--dark", "--title", "A corner", "--cut", "1.5")
    by = "class,confidence,entropy,variance,wall,rgb"
    assert run("render", built, "--by", by, "--cloud", scan, "--out", out, *SMALL, *looks) == 0
    with Image.open(out) as picture:
        assert picture.size[0] > 3 * 160
        assert picture.size[1] > 3 * 120
        assert picture.getpixel((0, 0)) == (24, 26, 30)


@pytest.mark.parametrize("suffix", [".gif", ".webp", ".png"])
def test_an_orbit(suffix: str, built: Path, tmp_path: Path) -> None:
    out = tmp_path / f"turn{suffix}"
    assert run("render", built, "--orbit", "--frames", "4", "--rate", "20", "--out", out, *SMALL, "--quiet") == 0
    with Image.open(out) as moving:
        assert getattr(moving, "n_frames", 1) == 4
        assert moving.size[0] == 160


def test_an_upward_axis_may_point_down(built: Path, tmp_path: Path) -> None:
    for up in ("z", "-z"):
        assert run("render", built, "--out", tmp_path / f"{up}.png", "--up", up, *SMALL, "--azimuth", "-70") == 0
    with Image.open(tmp_path / "z.png") as a, Image.open(tmp_path / "-z.png") as b:
        assert (np.asarray(a) != np.asarray(b)).any()


def test_a_slice_as_a_picture(built: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "slice.png"
    assert run("slice", built, "--height", "0.8", "--resolution", "0.05", "--out", out, "--json") == 0
    assert 0 < json.loads(capsys.readouterr().out)["observed"] <= 1
    with Image.open(out) as picture:
        assert picture.size[0] > 1400


@pytest.mark.parametrize("suffix", [".ply", ".glb"])
def test_the_surface_of_one_class(suffix: str, built: Path, tmp_path: Path) -> None:
    pytest.importorskip("skimage", reason="meshes need the extra mesh")
    trimesh = pytest.importorskip("trimesh", reason="GLB needs the extra mesh")
    out = tmp_path / f"table{suffix}"
    assert run("surface", built, "--of", "table", "--resolution", "0.1", "--out", out) == 0
    mesh = trimesh.load(out, force="mesh", process=False)
    low, high = mesh.bounds
    up = 1 if suffix == ".glb" else 2  # glTF: y upwards
    assert len(mesh.faces) > 50
    assert 0.5 < low[up] < high[up] < 1.1
    assert 0.2 < low[0] < high[0] < 1.8


@pytest.mark.parametrize(
    ("message", "arguments"),
    [
        ("ends in .png", ("render", "{built}", "--out", "{out}.jpg")),
        ("ends in .gif, .webp, .png", ("render", "{built}", "--orbit", "--out", "{out}.mp4")),
        ("choose from class, confidence", ("render", "{built}", "--by", "sofa", "--out", "{out}.png")),
        ("--cloud", ("render", "{built}", "--by", "rgb", "--out", "{out}.png")),
        ("nothing lies below", ("render", "{built}", "--cut", "-9", "--out", "{out}.png")),
        ("elevation lies between", ("render", "{built}", "--elevation", "100", "--out", "{out}.png")),
        ("positive number of metres", ("render", "{built}", "--resolution", "0", "--out", "{out}.png")),
        ("two frames", ("render", "{built}", "--orbit", "--frames", "1", "--out", "{out}.gif")),
        ("pictures a second", ("render", "{built}", "--orbit", "--rate", "99", "--out", "{out}.gif")),
        ("16 to 16,384 pixels", ("render", "{built}", "--size", "0", "9", "--out", "{out}.png")),
        ("--heights FROM TO", ("slice", "{built}", "--height", "1", "--out", "{out}.yaml")),
        ("one --height", ("slice", "{built}", "--heights", "0", "1", "--out", "{out}.png")),
        (".ply or .glb", ("surface", "{built}", "--resolution", "0.1", "--out", "{out}.obj")),
    ],
)  # fmt: skip
def test_bad_input(
    message: str, arguments: tuple[str, ...], built: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = (
        SMALL if arguments[0] == "render" and "--size" not in arguments and "--resolution" not in arguments else ()
    )
    assert run(*(a.format(built=built, out=tmp_path / "out") for a in arguments), *more) == 2
    captured = capsys.readouterr()
    assert message in " ".join((captured.err + captured.out).split())
    assert not list(tmp_path.iterdir())
