"""`semgp evaluate`: totals, scores by class, the confusion matrix, pictures."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from sklearn import metrics as sk

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.maps.files import load_map
from semgp.writers import write_npz
from tests.cli.test_commands import run


@pytest.fixture
def built(scan: Path) -> Path:
    out = scan.with_name("map.semgp")
    run("build", scan, "--out", out, "--kind", "csm", "--quiet")
    return out


@pytest.fixture
def truth(corner: LabelledCloud, tmp_path: Path) -> Path:
    """Every label known, some of them wrong, none of a table; a sensor's noise away from the map's voxels."""
    labels = np.repeat([0, 1, 1], [150, 150, 60])
    labels[::7] = 1
    rng = np.random.default_rng(1)
    moved = corner.points + np.where(rng.random((360, 1)) < 0.2, 0.5, 0.0)
    write_npz(tmp_path / "truth.npz", replace(corner, points=moved, labels=labels))
    return tmp_path / "truth.npz"


def test_by_class_as_json(built: Path, truth: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run("evaluate", built, "--truth", truth, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    with np.load(truth) as arrays:
        points, labels = arrays["points"], arrays["labels"]
    answer = load_map(built).query(points)
    seen = answer.observed
    assert said["confusion"] == sk.confusion_matrix(labels[seen], answer.label[seen], labels=[0, 1, 2]).tolist()
    assert said["not_observed"] == np.bincount(labels[~seen], minlength=3).tolist()
    floor, wall, table = said["classes"]
    given = np.where(seen, answer.label, -1)
    exact, found, _, n = sk.precision_recall_fscore_support(labels, given, labels=[0, 1])
    assert [floor["precision"], wall["precision"]] == pytest.approx(exact)
    assert [floor["recall"], wall["recall"]] == pytest.approx(found)
    assert [floor["points"], wall["points"]] == n.tolist()
    ranked = np.where(seen, answer.probability[:, 0], 0)
    assert floor["auc"] == pytest.approx(sk.roc_auc_score(labels == 0, ranked))
    assert (wall["confused_with"], wall["confused"]) == ("table", said["confusion"][1][2])
    assert table["points"] == 0
    assert table["iou"] is None
    assert said["figures"] is None


def test_by_class_for_people(built: Path, truth: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run("evaluate", built, "--truth", truth) == 0
    text = capsys.readouterr().out
    assert all(heading in text for heading in ("mIoU", "precision", "recall", "p(true)", "taken for"))
    absent = " ".join(text.split()).partition("not in the truth, and in no mean: ")[2]
    assert absent.startswith("table (given to ")


def test_points_without_truth_do_not_count(built: Path, scan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run("evaluate", built, "--truth", scan, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    with np.load(scan) as arrays:
        assert said["n_points"] == np.count_nonzero(arrays["labels"] >= 0) < len(arrays["labels"])
    assert np.sum(said["confusion"]) + np.sum(said["not_observed"]) == said["n_points"]


def test_figures(built: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "scores"
    assert run("evaluate", built, "--truth", truth, "--figures", folder, "--quiet") == 0
    assert sorted(path.name for path in folder.iterdir()) == ["confusion.png", "reliability.png"]
    for path in folder.iterdir():
        with Image.open(path) as image:
            assert min(image.size) > 300
            assert len(image.convert("RGB").getcolors(1 << 24) or ()) > 20
    assert run("evaluate", built, "--truth", truth, "--figures", built) == 2
    assert "give the name of a folder" in capsys.readouterr().err


def test_figures_need_matplotlib(
    built: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert run("evaluate", built, "--truth", truth, "--figures", tmp_path / "scores") == 2
    assert "semgp[figures]" in capsys.readouterr().err
    assert not (tmp_path / "scores").exists()


def test_truth_without_labels(built: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = LabelledCloud(np.zeros((4, 3)), Classes(("floor", "wall", "table")), labels=np.full(4, -1))
    write_npz(tmp_path / "bare.npz", bare)
    assert run("evaluate", built, "--truth", tmp_path / "bare.npz") == 2
    assert "no point has a true label" in capsys.readouterr().err
