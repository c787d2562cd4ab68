"""`semgp info`: every kind of map in words, and its facts as JSON."""

import json
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.cli.console import _plain
from semgp.cli.describe import elements, kind_of, label_shares
from semgp.cli.models import kernel_words, model_rows
from semgp.cloud import LabelledCloud
from semgp.gp.model import GPModel
from semgp.gp.stationary import Matern32, Matern52, SquaredExponential
from semgp.maps.files import load_map, save_map
from semgp.maps.gp import GPSemanticMap
from semgp.maps.kinds import MAP_KINDS
from semgp.maps.presets import PRESETS
from semgp.store import MapStore, Settings
from tests.cli.test_commands import run

BUILDS = {
    "gp": ("--free-space",),
    "paper": ("--model", "paper", "--no-learn", "--inducing", "20"),
    "half-life": ("--half-life", "30"),
    **{kind: ("--kind", kind) for kind in MAP_KINDS if kind != "gp"},
}


def told(place: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    """Return what `semgp info` says by heading, the first line under "is"."""
    capsys.readouterr()
    with chdir(place.parent):
        assert run("info", place.name) == 0
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    heading, said = "is", {"is": ""}
    for line in lines:
        if said["is"] and not line.startswith(" "):
            heading, _, line = line.partition("  ")
        said[heading] = f"{said.get(heading, '')} {line.strip()}".strip()
    return said


@pytest.fixture(params=BUILDS)
def built(request: pytest.FixtureRequest, scan: Path) -> Path:
    out = scan.with_name(f"{request.param}.semgp")
    assert run("build", scan, "--out", out, "--quiet", *BUILDS[request.param]) == 0
    return out


def test_every_kind_in_words_and_as_json(
    built: Path, corner: LabelledCloud, capsys: pytest.CaptureFixture[str]
) -> None:
    semantic_map, said = load_map(built), told(built, capsys)
    assert said["is"] == f"{built.name}: {kind_of(semantic_map)}"
    assert said["data"].startswith(elements(semantic_map))
    spatial = built.stem in ("gp", "half-life", "octomap")
    assert said["free space"].startswith("yes" if spatial else "no")
    assert ("forgets" in said) == (built.stem == "half-life")
    assert ("kernel" in said) == (semantic_map.kind == "gp")
    sizes = [float(part) for part in said["extent"].split(" m,")[0].split(" x ")]
    np.testing.assert_allclose(sizes, np.ptp(semantic_map.positions, axis=0), atol=0.006)
    assert said["classes"].startswith("3, by their share of the labels: ")
    assert not any(mark in " ".join(list(said.values())[1:]) for mark in "{}[]_")

    assert run("info", built, "--json") == 0
    assert json.loads(capsys.readouterr().out) == _plain(semantic_map.info())


def test_shares_are_those_of_the_labels(built: Path, corner: LabelledCloud) -> None:
    labels = corner.hard_labels[corner.labelled]
    share = label_shares(load_map(built))
    assert share is not None
    spread = 0.1 if built.stem == "bki" else 1e-6  # its kernel spreads labels over voxels
    np.testing.assert_allclose(share, np.bincount(labels) / len(labels), atol=spread)


def test_words_for_what_maps_are_made_of(built: Path, corner: LabelledCloud) -> None:
    words = {"gp": "sites", "half-life": "sites", "paper": "labelled points", "knn": "points"}
    semantic_map = load_map(built)
    assert elements(semantic_map) == f"{len(semantic_map):,} {words.get(built.stem, 'voxels')}"


def test_classes_without_labels_stand_apart(
    corner: LabelledCloud, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = Classes(("floor", "wall", "table", "sofa [red]"))
    semantic_map = MAP_KINDS["csm"](more)  # type: ignore[call-arg]
    save_map(semantic_map, tmp_path / "empty.semgp")
    said = told(tmp_path / "empty.semgp", capsys)
    assert said["classes"] == "4: floor, wall, table, sofa [red]"
    assert said["extent"] == "no data yet"
    semantic_map.update(LabelledCloud(corner.points, more, corner.labels))
    save_map(semantic_map, tmp_path / "map.semgp")
    assert told(tmp_path / "map.semgp", capsys)["classes"].endswith("; without labels: sofa [red]")


def test_a_store(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    empty = MapStore(tmp_path / "empty")
    empty.create(Settings(Classes(("floor", "wall", "table")), PRESETS["general"]), "")
    assert told(tmp_path / "empty", capsys)["extent"] == "no data yet"
    assert run("build", scan, "--out", tmp_path / "store", "--quiet") == 0
    said = told(tmp_path / "store", capsys)
    assert "stored in tiles" in said["is"]
    assert said["data"].endswith("from 1 scan")
    assert said["version"].startswith("2, written 20")
    assert said["classes"] == "3: floor, wall, table"
    low, high = (eval(corner) for corner in said["extent"].partition("from ")[2].split(", in ")[0].split(" to "))
    positions = load_map(tmp_path / "store").positions
    assert (positions >= low).all()
    assert (positions <= high).all()


@pytest.mark.parametrize(
    ("kernel", "features", "words"),
    [
        (Matern52((0.35,), 2.0), (), "Matérn 5/2, length scale 0.35 m, signal deviation 2"),
        (
            Matern32((1.0, 2.0, 0.5), 1.0),
            (),
            "Matérn 3/2, length scales 1 m along x, 2 m along y, 0.5 m along z, signal deviation 1",
        ),
        (
            SquaredExponential((0.1,), 1.0, (3, 4)),
            ("red", "green"),
            "squared exponential, length scale 0.1 along red, green, signal deviation 1",
        ),
        (
            Matern52((1.0,), 1.0, (0, 1)) * Matern52((2.0,), 1.0, (2,)),
            (),
            "(Matérn 5/2, length scale 1 m along x, y, signal deviation 1) x "
            "(Matérn 5/2, length scale 2 m along z, signal deviation 1)",
        ),
    ],
)
def test_kernels_in_words(kernel: Matern52, features: tuple[str, ...], words: str) -> None:
    assert kernel_words(kernel, features) == words


def test_models_of_one_kernel_a_class() -> None:
    model = GPModel(kernels=(Matern52((1.0,)), Matern52((2.0,))), m=(-1.0, -0.5), n_inducing=None, inference="ep")
    said = dict(model_rows(model, Classes(("floor", "wall"))))
    assert said["kernel"].splitlines()[1].startswith("wall: Matérn 5/2, length scale 2 m")
    assert said["mean"] == "-1 to -0.5, by class"
    assert "dense" in said["posterior"]
    assert "expectation propagation" in said["posterior"]
    assert kind_of(GPSemanticMap(Classes(("floor", "wall")), model)).endswith("the paper's")


def test_experts_and_votes() -> None:
    classes = Classes(("floor", "wall"))
    for name, words in (("laplace", "laplace, block by block"), ("vote", "vote 1;")):
        model = type(PRESETS["general"])(posterior=name)
        assert words in dict(model_rows(model, classes))["posterior"]
