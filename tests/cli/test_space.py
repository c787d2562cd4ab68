"""Free space on the command line: build, query, fuse, surface, slice."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgp.maps.files import load_map
from semgp.readers import read
from tests.cli.test_commands import run


@pytest.fixture
def built(scan: Path) -> Path:
    out = scan.with_name("map.semgp")
    assert run("build", scan, "--free-space", "--resolution", "0.1", "--out", out, "--quiet") == 0
    return out


def test_query_tells_what_is_occupied(built: Path, scan: Path) -> None:
    out = built.with_name("points.npz")
    assert run("query", built, "--points", scan, "--out", out, "--quiet") == 0
    with np.load(out) as answer:
        assert (answer["occupancy"] > 0.5).mean() > 0.9
        assert (answer["state"] == 1).mean() > 0.9


def test_fuse_with_itself_moved_back(built: Path, tmp_path: Path) -> None:
    np.savetxt(tmp_path / "T.txt", np.eye(4))
    out = tmp_path / "both.semgp"
    assert run("fuse", built, built, "--transform", tmp_path / "T.txt", "--out", out) == 0
    assert len(load_map(out)) == len(load_map(built))


def test_surface(built: Path) -> None:
    pytest.importorskip("skimage", reason="meshes need the extra mesh")
    out = built.with_name("mesh.ply")
    assert run("surface", built, "--resolution", "0.1", "--out", out, "--quiet") == 0
    assert len(read(out)) > 100


def test_slice(built: Path, tmp_path: Path) -> None:
    (tmp_path / "costs.json").write_text(json.dumps({"floor": 0, "wall": 100}))
    out = tmp_path / "slice.yaml"
    common = ("slice", built, "--heights", "0.2", "0.6", "--out", out)
    assert run(*common, "--costs", tmp_path / "costs.json") == 0
    assert "resolution: 0.1" in out.read_text()
    with Image.open(out.with_suffix(".pgm")) as picture:
        assert min(picture.size) > 15


@pytest.mark.parametrize(
    ("message", "arguments"),
    [
        ("GP map of many blocks", ("build", "{scan}", "--out", "{out}", "--free-space", "--kind", "knn")),
        ("half_life must be a number, positive", ("build", "{scan}", "--out", "{out}", "--half-life", "-1")),
        ("keeps no free space", ("surface", "{plain}", "--resolution", "0.1", "--out", "{out}.ply")),
        ("written as .ply", ("surface", "{built}", "--resolution", "0.1", "--out", "{out}")),
        ("called 'sofa'", ("surface", "{built}", "--resolution", "0.1", "--of", "sofa", "--out", "{out}.ply")),
        ("is no 4 x 4 matrix", ("fuse", "{built}", "{built}", "--transform", "{scan}", "--out", "{out}")),
        ("cannot be read", ("fuse", "{built}", "{built}", "--transform", "{out}.txt", "--out", "{out}")),
        ("only GP maps", ("fuse", "{built}", "{knn}", "--out", "{out}")),
        ("cannot be read", ("slice", "{built}", "--heights", "0", "1", "--costs", "{out}.txt", "--out", "{out}")),
    ],
)  # fmt: skip
def test_bad_input(
    message: str,
    arguments: tuple[str, ...],
    built: Path,
    scan: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    names = {"scan": scan, "built": built, "out": tmp_path / "out.semgp"}
    for kind in ("gp", "knn"):
        names["plain" if kind == "gp" else kind] = tmp_path / f"{kind}.semgp"
        run("build", scan, "--kind", kind, "--out", tmp_path / f"{kind}.semgp", "--quiet")
    capsys.readouterr()
    assert run(*(a.format(**names) for a in arguments)) == 2
    captured = capsys.readouterr()
    assert message in " ".join((captured.err + captured.out).split())
    assert not list(tmp_path.glob("out*"))
