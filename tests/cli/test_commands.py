"""The commands as a user types them: what they print, write, and how they end."""

import json
from pathlib import Path

import numpy as np
import pytest

from semgp.cli import main
from semgp.cloud import LabelledCloud
from semgp.readers import read
from semgp.writers import write_npz


@pytest.fixture
def built(scan: Path) -> Path:
    out = scan.with_name("map.semgp")
    run("build", scan, "--out", out, "--quiet")
    return out


def run(*arguments: object) -> int:
    try:
        main([str(a) for a in arguments])
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def test_build_query_evaluate_info(built: Path, scan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = built.parent
    assert run("info", built) == 0
    assert "floor" in capsys.readouterr().out
    assert run("info", built, "--json") == 0
    assert json.loads(capsys.readouterr().out)["kind"] == "gp"
    assert run("query", built, "--resolution", "0.25", "--out", folder / "grid.ply", "--quiet") == 0
    assert run("query", built, "--points", scan, "--out", folder / "points.npz", "--quiet") == 0
    assert len(read(folder / "grid.ply")) > 50
    with np.load(folder / "points.npz") as answer:
        assert {"points", "weights", "label", "entropy", "variance", "observed"} <= set(answer.files)
        np.testing.assert_allclose(answer["weights"].sum(axis=1), 1, rtol=1e-5)
    capsys.readouterr()
    assert run("evaluate", built, "--truth", scan, "--json") == 0
    assert json.loads(capsys.readouterr().out)["accuracy"] > 0.95
    assert run("evaluate", built, "--truth", scan) == 0
    assert "accuracy" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["octomap", "knn", "csm", "bki"])
def test_every_kind_is_built(kind: str, scan: Path) -> None:
    out = scan.with_name("map.semgp")
    assert run("build", scan, "--out", out, "--kind", kind, "--quiet") == 0
    assert run("query", out, "--resolution", "0.5", "--out", scan.with_name("grid.ply"), "--quiet") == 0


def test_results_open_as_clouds_again(built: Path) -> None:
    out = built.with_name("grid.ply")
    run("query", built, "--resolution", "0.25", "--out", out, "--quiet")
    cloud = read(out)
    assert cloud.classes.names == ("floor", "wall", "table")
    assert cloud.colours is not None


class TestBadInput:
    def fails(self, capsys: pytest.CaptureFixture[str], message: str, *arguments: object) -> None:
        assert run(*arguments) == 2
        captured = capsys.readouterr()
        assert message in " ".join((captured.err + captured.out).split())
        assert "Traceback" not in captured.err

    def test_files_that_are_missing_or_unknown(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        out = tmp_path / "map.semgp"
        self.fails(capsys, "no such file", "build", tmp_path / "absent.ply", "--out", out)
        (tmp_path / "scan.doc").write_text("0 0 0")
        self.fails(capsys, "is of no format that semgp reads", "build", tmp_path / "scan.doc", "--out", out)
        self.fails(capsys, "no such file", "info", out)
        assert not out.exists()

    def test_truncated_files(self, built: Path, scan: Path, capsys: pytest.CaptureFixture[str]) -> None:
        for path in (built, scan):
            path.write_bytes(path.read_bytes()[:500])
        self.fails(capsys, "map.semgp", "info", built)
        self.fails(capsys, "scan.npz", "build", scan, "--out", scan.with_name("other.semgp"))
        assert not scan.with_name("other.semgp").exists()

    def test_a_failed_build_keeps_the_old_map(
        self, built: Path, corner: LabelledCloud, capsys: pytest.CaptureFixture[str]
    ) -> None:
        before = built.read_bytes()
        one_class = built.with_name("floor.npz")
        write_npz(one_class, corner[corner.hard_labels == 0])
        self.fails(capsys, "at least two", "build", one_class, "--model", "paper", "--out", built, "--quiet")
        assert built.read_bytes() == before

    def test_no_labels(self, corner: LabelledCloud, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        write_npz(tmp_path / "bare.npz", corner[corner.hard_labels < 0])
        out = tmp_path / "map.semgp"
        for kind in ("gp", "knn"):
            self.fails(capsys, "label", "build", tmp_path / "bare.npz", "--out", out, "--kind", kind, "--quiet")
        assert not out.exists()

    def test_options(self, built: Path, scan: Path, capsys: pytest.CaptureFixture[str]) -> None:
        out = built.with_name("out.ply")
        self.fails(capsys, "either --points FILE or --resolution", "query", built, "--out", out)
        self.fails(capsys, "positive number of metres", "query", built, "--resolution", "-1", "--out", out)
        self.fails(capsys, ".ply, .npz", "query", built, "--resolution", "1", "--out", built.with_name("out.doc"))
        self.fails(capsys, "folder", "query", built, "--resolution", "1", "--out", built.parent / "no" / "out.ply")
        self.fails(capsys, "Unknown option", "build", scan, "--out", out, "--flavour", "blue")
        self.fails(capsys, "classes", "evaluate", built, "--truth", self.other_classes(built))

    @staticmethod
    def other_classes(near: Path) -> Path:
        from semgp.classes import Classes

        path = near.with_name("other.npz")
        write_npz(path, LabelledCloud(np.zeros((2, 3)), Classes(("road", "car")), np.array([0, 1])))
        return path

    def test_reproduce(self, tmp_path: Path, data_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.fails(capsys, "no method is called magic", "reproduce", "nyu", data_dir / "nyu", "--methods", "magic")
        self.fails(capsys, "whole numbers", "reproduce", "nyu", data_dir / "nyu", "--frames", "first")
        self.fails(capsys, "noisy experiment", "reproduce", "nyu", data_dir / "nyu", "--soft")
        self.fails(capsys, "7", "reproduce", "nyu", data_dir / "nyu", "--frames", "7", "--methods", "knn")
        self.fails(capsys, "no NYU folder", "reproduce", "nyu", tmp_path)


def test_reproduce_writes_the_rows(data_dir: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("--frames", "282", "--methods", "knn,csm", "--json")
    assert run("reproduce", "nyu", data_dir / "nyu", *arguments) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["method"] for row in rows] == ["knn", "csm"]
    wanted = {
        "frame",
        "method",
        "experiment",
        "auc",
        "accuracy",
        "miou",
        "nll",
        "ece",
        "coverage",
        "n_train",
        "n_query",
    }
    wanted |= {"n_classes", "fit_seconds", "query_seconds", "peak_rss_mb"}
    assert all(wanted <= row.keys() for row in rows)
    assert rows[1]["auc"] == pytest.approx(0.8816, abs=2e-3)


@pytest.mark.parametrize(
    "command", [(), ("demo",), ("build",), ("query",), ("evaluate",), ("info",), ("reproduce", "nyu")]
)
def test_help_shows_an_example(command: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*command, "--help") == 0
    text = capsys.readouterr().out
    assert "Usage" in text
    if command:
        assert "Example: semgp " + " ".join(command) in " ".join(text.split())


class TestBlockModels:
    @pytest.fixture
    def scans(self, corner: LabelledCloud, tmp_path: Path) -> list[Path]:
        paths = [tmp_path / f"scan{i}.npz" for i in range(2)]
        for i, path in enumerate(paths):
            write_npz(path, corner[i::2])
        return paths

    def test_a_learned_model_builds_a_map(self, scans: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
        model, out = scans[0].with_name("model.json"), scans[0].with_name("map.semgp")
        assert run("learn", *scans, "--model", "general", "--resolution", "0.1", "--out", model, "--quiet") == 0
        assert json.loads(model.read_text())["resolution"] == 0.1
        assert run("build", *scans, "--model", model, "--out", out, "--quiet") == 0
        capsys.readouterr()
        assert run("info", out, "--json") == 0
        assert json.loads(capsys.readouterr().out)["model"] == json.loads(model.read_text())

    @pytest.mark.parametrize("preset", ["general", "indoor-rgbd", "indoor-labels", "outdoor-lidar", "paper"])
    def test_every_preset_builds_a_map(self, preset: str, scans: list[Path]) -> None:
        out = scans[0].with_name("map.semgp")
        options = ("--no-learn", "--up", "y", "--inducing", "30")
        assert run("build", *scans, "--model", preset, "--out", out, "--quiet", *options) == 0

    @pytest.mark.parametrize(
        ("text", "message"),
        [(None, "cannot be read"), ("{", "is no model"), ("{}", "is no model"), ("[1, 2]", "is no model")],
    )
    def test_models_that_are_none(
        self, text: str | None, message: str, scans: list[Path], capsys: pytest.CaptureFixture[str]
    ) -> None:
        model = scans[0].with_name("model.json")
        if text is not None:
            model.write_text(text)
        TestBadInput().fails(
            capsys, message, "build", *scans, "--model", model, "--out", model.with_name("m.semgp")
        )

    def test_one_scan_cannot_judge_itself(self, scans: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
        model = scans[0].with_name("model.json")
        TestBadInput().fails(capsys, "two with labels at least", "learn", scans[0], "--out", model)
        assert not model.exists()


def test_finer_than_the_map(built: Path, tmp_path: Path) -> None:
    numbers = []
    for resolution in ("0.1", "0.02"):
        out = tmp_path / f"at-{resolution}.ply"
        assert run("query", built, "--resolution", resolution, "--out", out, "--quiet") == 0
        numbers.append(len(read(out)))
    assert numbers[1] > 6 * numbers[0]
