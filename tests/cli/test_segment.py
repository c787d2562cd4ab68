"""`semgp segment`, and maps of RGB-D recordings with a network's labels."""

import json
from pathlib import Path

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.maps.files import load_map
from semgp.readers.label_folder import LabelFolder
from tests.cli.test_commands import run
from tests.networks import write_onnx
from tests.rgbd_samples import SHAPE, write_seven_scenes

MAPPING = (
    '[[class]]\nname = "warm"\ncolour = "#ff0000"\nfrom = ["red"]\n[[class]]\nname = "cold"\nfrom = ["blue"]\n'
)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """An RGB-D folder, with a network and class files beside it."""
    write_onnx(tmp_path / "net.onnx")
    (tmp_path / "rgb.csv").write_text("name\nred\ngreen\nblue\n")
    (tmp_path / "map.toml").write_text(MAPPING)
    path = write_seven_scenes(tmp_path)
    for file in (path / "labels").iterdir():
        file.unlink()
    (path / "labels").rmdir()
    return path


def segment(recording: Path, *more: object) -> int:
    beside = recording.parent
    common = ("--model", beside / "net.onnx", "--classes", beside / "rgb.csv", "--labels", beside / "map.toml")
    return run("segment", recording, *common, *more)


def test_labels_of_a_recording(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = recording / "labels"
    assert segment(recording, "--out", out) == 0
    assert "3 images labelled" in capsys.readouterr().out
    folder = LabelFolder(out)
    assert folder.classes.names == ("warm", "cold")
    assert folder.classes.colours[0] == (255, 0, 0)
    assert folder.labels("frame-000005.color").shape == SHAPE
    probability = folder.probability("frame-000005.color")
    assert probability is not None
    assert probability[0].shape == (8, 8, 2)


def test_it_goes_on_where_it_stopped(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = recording.parent / "labels"
    assert segment(recording, "--out", out, "--no-soft") == 0
    assert not list(out.glob("*.npz"))
    (out / "frame-000005.color.png").unlink()
    kept = {file: file.stat().st_mtime_ns for file in out.glob("*.png")}
    capsys.readouterr()
    assert segment(recording, "--out", out, "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["images"], facts["kept"], facts["classes"]) == (1, 2, ["warm", "cold"])
    assert all(file.stat().st_mtime_ns == at for file, at in kept.items())
    assert segment(recording, "--out", out, "--overwrite", "--json") == 0
    assert json.loads(capsys.readouterr().out)["images"] == 3


def test_one_command_and_two_make_the_same_map(recording: Path) -> None:
    beside = recording.parent
    build = ("build", recording, "--resolution", "0.2", "--no-learn", "--quiet")
    network = ("--network", beside / "net.onnx", "--classes", beside / "rgb.csv", "--remap", beside / "map.toml")
    assert run(*build, *network, "--out", beside / "one.semgp") == 0
    assert segment(recording, "--out", recording / "labels") == 0
    assert run(*build, "--out", beside / "two.semgp") == 0
    one, two = load_map(beside / "one.semgp"), load_map(beside / "two.semgp")
    assert one.classes == two.classes
    assert one.classes.names == ("warm", "cold")
    np.testing.assert_allclose(one.positions, two.positions, atol=2e-3)  # means, weighted by 8 bits
    at = one.positions[:50]
    np.testing.assert_allclose(one.query(at).probability, two.query(at).probability, atol=0.02)


def test_options_of_recordings(recording: Path) -> None:
    out = recording.parent / "map.semgp"
    network = ("--network", recording.parent / "net.onnx")
    common = ("build", recording, *network, "--kind", "octomap", "--out", out, "--quiet")
    assert run(*common) == 0
    assert load_map(out).classes == Classes.numbered(3)
    n = len(load_map(out))
    assert run(*common, "--stride", "3", "--max-depth", "3") == 0
    assert len(load_map(out)) < n


@pytest.mark.parametrize(
    ("message", "arguments"),
    [
        ("no such file or folder", ("segment", "{nothing}", "--model", "{net}", "--out", "{out}")),
        ("ends in .tflite or .onnx", ("segment", "{seven}", "--model", "{toml}", "--out", "{out}")),
        ("is a file; give the name of a folder", ("segment", "{seven}", "--model", "{net}", "--out", "{toml}")),
        (
            "say which list they are",
            ("segment", "{seven}", "--model", "{net}", "--labels", "{toml}", "--out", "{out}"),
        ),
        ("give an RGB-D folder", ("build", "{ply}", "--network", "{net}", "--out", "{out}")),
    ],
)
def test_bad_input(
    message: str, arguments: tuple[str, ...], recording: Path, scan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    beside = recording.parent
    names = {"nothing": beside / "nothing", "net": beside / "net.onnx", "toml": beside / "map.toml"}
    names |= {"seven": recording, "out": beside / "out", "ply": scan}
    assert run(*(argument.format(**names) for argument in arguments)) == 2
    assert message in capsys.readouterr().err
