"""Stores on the command line: built, interrupted, resumed, updated, rolled back, checked, cut and joined."""

import json
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

from semgp.cli.places import named
from semgp.maps.files import load_map
from semgp.maps.presets import GENERAL
from semgp.store import Manifest, MapStore, Settings, StoredMap
from semgp.writers import write_npz
from tests.cli.test_commands import run
from tests.store.scenes import CLASSES, assert_same, cloud, in_memory, places

SCANS = 20
FAST = ("--no-learn", "--workers", "1", "--quiet")


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Point files along a street."""
    folder = tmp_path_factory.mktemp("scans")
    paths = [folder / f"{i:02d}.npz" for i in range(SCANS)]
    for i, path in enumerate(paths):
        write_npz(path, cloud(i, i % 10, n=80))
    return paths


@pytest.fixture
def built(scans: list[Path], tmp_path: Path) -> Path:
    """A store of the first four scans."""
    assert run("build", *scans[:4], "--out", tmp_path / "drive", *FAST) == 0
    return tmp_path / "drive"


def wanted(*seeds: int, settings: Settings | None = None) -> Any:
    settings = settings or Settings(CLASSES, GENERAL)
    return in_memory(settings, *(cloud(i, i % 10, n=80) for i in seeds)).query(places(1))


def said(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    """Run a command, and return its JSON."""
    capsys.readouterr()
    assert run(*arguments, "--json") == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Run a command that must end with 2 and one message, and return that."""
    capsys.readouterr()
    assert run(*arguments) == 2
    error = capsys.readouterr().err
    assert "Traceback" not in error
    return " ".join(error.split())


def test_a_build_to_a_folder_is_a_store(built: Path) -> None:
    made = load_map(built)
    assert isinstance(made, StoredMap)
    assert_same(made.query(places(1)), wanted(*range(4)))
    assert (made.clouds, MapStore(built).numbers()) == (4, [2])  # steps on the way are not kept


@pytest.mark.parametrize("forgets", [False, True])
def test_an_interrupted_build_goes_on(
    forgets: bool, scans: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = ("--half-life", "5") if forgets else ()
    command = ("build", *scans, "--out", tmp_path / "drive", *FAST, *more)
    add = MapStore.add

    def interrupted(store: MapStore, manifest: Manifest) -> None:
        if manifest.number == 3:
            raise KeyboardInterrupt
        add(store, manifest)

    with mock.patch.object(MapStore, "add", interrupted):
        assert run(*command) == 130
    assert "holds version 2 with 8 scans; --resume goes on" in " ".join(capsys.readouterr().err.split())
    assert MapStore(tmp_path / "drive").manifest().clouds == 8
    assert "holds a map already" in refused(capsys, *command)
    assert run(*command, "--resume") == 0
    settings = Settings(CLASSES, GENERAL)
    if forgets:
        settings = MapStore(tmp_path / "drive").manifest().settings
        assert settings.forgetting is not None
    assert_same(StoredMap(tmp_path / "drive").query(places(1)), wanted(*range(SCANS), settings=settings))
    assert run(*command, "--resume") == 0  # nothing is left to do
    assert MapStore(tmp_path / "drive").manifest().clouds == SCANS


def test_an_interrupted_update_recommends_nothing_that_it_has_not(
    built: Path, scans: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    with mock.patch.object(MapStore, "add", side_effect=KeyboardInterrupt):
        assert run("update", built, scans[4], "--workers", "1") == 130
    error = " ".join(capsys.readouterr().err.split())
    assert "holds version 2 with 4 scans" in error
    assert "--resume" not in error


def test_resuming_may_begin_a_build(scans: list[Path], tmp_path: Path) -> None:
    assert run("build", scans[0], "--out", tmp_path / "drive", *FAST, "--resume") == 0
    assert MapStore(tmp_path / "drive").manifest().clouds == 1


def test_resuming_a_build_that_is_whole_keeps_its_versions(built: Path, scans: list[Path]) -> None:
    run("update", built, scans[4], "--quiet")
    assert run("build", *scans[:4], "--out", built, *FAST, "--resume") == 2
    assert MapStore(built).numbers() == [2, 3]


def test_a_build_ends_well_beside_another_writer(scans: list[Path], tmp_path: Path) -> None:
    add = MapStore.add
    other: list[StoredMap] = []

    def beside(store: MapStore, manifest: Manifest) -> None:
        add(store, manifest)
        if manifest.clouds:
            other.append(StoredMap(tmp_path / "drive"))
            other[0].update(cloud(9))

    with mock.patch.object(MapStore, "add", beside):
        code = run("build", *scans[:4], "--out", tmp_path / "drive", *FAST)
    other[0].close()
    assert MapStore(tmp_path / "drive").manifest().clouds == 4
    assert code == 0


def test_update_adds_versions(built: Path, scans: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    facts = said(capsys, "update", built, *scans[4:6], "--workers", "1")
    assert (facts["version"], facts["scans"]) == (3, 6)
    assert_same(StoredMap(built).query(places(1)), wanted(*range(6)))


def test_versions_rollback_prune_check_and_clean(
    built: Path, scans: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    run("update", built, scans[4], "--quiet")
    listed = said(capsys, "store", "versions", built)["versions"]
    assert [(v["version"], v["scans"]) for v in listed] == [(2, 4), (3, 5)]
    assert said(capsys, "store", "rollback", built, "--to", "2", "--note", "back")["version"] == 4
    assert_same(StoredMap(built).query(places(1)), wanted(*range(4)))
    assert said(capsys, "store", "check", built)["tiles"] == len(MapStore(built).manifest().tiles)
    assert said(capsys, "store", "prune", built, "--keep", "1")["files_removed"] > 0
    assert MapStore(built).numbers() == [4]
    orphan = built / "tiles" / f"{0:016x}-{'0' * 32}.npz"
    orphan.write_bytes(b"left by a writer that died")
    assert said(capsys, "store", "clean", built)["files_removed"] == 0
    assert said(capsys, "store", "clean", built, "--older-than", "0")["files_removed"] == 1
    assert run("store", "versions", built) == 0
    assert "back" in capsys.readouterr().out


def test_check_names_what_is_damaged(built: Path, scans: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    before = set((built / "tiles").iterdir())
    assert run("update", built, scans[4], "--quiet") == 0
    path = sorted(set((built / "tiles").iterdir()) - before)[0]
    path.write_bytes(path.read_bytes()[:-1])
    assert path.name in refused(capsys, "store", "check", built).replace(" ", "")
    assert run("store", "check", built, "--version", "2") == 0
    assert "damaged" in refused(capsys, "query", built, "--resolution", "0.2", "--out", built.parent / "x.ply")
    assert not (built.parent / "x.ply").exists()
    manifest = built / "manifests" / "00000003.json"
    manifest.write_bytes(b"damaged")
    assert run("store", "versions", built) == 2  # the newest cannot be read
    assert "00000003.json" in refused(capsys, "info", built).replace(" ", "")


def test_info_and_query_of_a_store(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    facts = said(capsys, "info", built)
    assert (facts["version"], facts["clouds"], facts["kind"]) == (2, 4, "gp")
    np.savez(built.parent / "points.npz", points=places(1))
    out = built.parent / "answer.npz"
    assert run("query", built, "--points", built.parent / "points.npz", "--out", out, "--quiet") == 0
    with np.load(out) as answer:
        np.testing.assert_allclose(answer["weights"], wanted(*range(4)).probability, atol=1e-6)


def test_crop_to_a_file_and_to_a_store(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    box = ("--low", 0, 0, -1, "--high", 3, 3, 1)
    for out in (built.parent / "part.semgp", built.parent / "part"):
        facts = said(capsys, "crop", built, *box, "--out", out)
        assert facts["sites"] == len(load_map(out)) == len(StoredMap(built).crop((0, 0, -1), (3, 3, 1)))
    nowhere = ("--low", 100, 0, 0, "--high", 101, 1, 1)
    assert "has no data between" in refused(capsys, "crop", built, *nowhere, "--out", built.parent / "none")
    assert not (built.parent / "none").exists()
    assert "corners" in refused(capsys, "crop", built, "--low", 1, 1, 1, "--high", 0, 0, 0, "--out", "none.semgp")


def test_fuse_stores_and_files(
    built: Path, scans: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("build", scans[4], "--out", tmp_path / "other", *FAST) == 0
    assert run("build", scans[4], "--out", tmp_path / "other.semgp", "--no-learn", "--quiet") == 0
    for other, out in (("other", "both"), ("other.semgp", "both-2"), ("other", "both.semgp")):
        assert said(capsys, "fuse", built, tmp_path / other, "--out", tmp_path / out)["sites"] > 0
        assert_same(load_map(tmp_path / out).query(places(1)), wanted(*range(5)))
    assert "holds a map already" in refused(capsys, "fuse", built, tmp_path / "other", "--out", tmp_path / "both")


def test_export_of_a_store_to_zarr(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    zarr = pytest.importorskip("zarr", reason="grids need the extra zarr")
    out = built.parent / "grid.zarr"
    assert run("export", built, "--out", out, "--resolution", "0.2", "--quiet") == 0
    assert zarr.open_group(out, mode="r")["label"].ndim == 3
    assert "there already" in refused(capsys, "export", built, "--out", out, "--resolution", "0.2")


@pytest.mark.parametrize(
    ("message", "arguments"),
    [
        ("holds a map already", ("build", "{scan}", "--out", "{drive}")),
        ("only GP maps of many blocks", ("build", "{scan}", "--out", "{new}", "--kind", "knn")),
        ("only GP maps of many blocks", ("build", "{scan}", "--out", "{new}", "--model", "paper")),
        ("are for stores", ("build", "{scan}", "--out", "{new}.semgp", "--resume")),
        ("are for stores", ("build", "{scan}", "--out", "{new}.semgp", "--executor", "ray")),
        ("no such file", ("build", "{new}.npz", "--out", "{new}")),
        ("threads have no address", ("update", "{drive}", "{scan}", "--address", "auto")),
        ("at least one worker", ("update", "{drive}", "{scan}", "--workers", "0")),
        ("no version 9", ("store", "rollback", "{drive}", "--to", "9")),
        ("at least one version", ("store", "prune", "{drive}", "--keep", "0")),
        ("no version 9", ("store", "check", "{drive}", "--version", "9")),
        ("no such file or folder", ("store", "versions", "{new}")),
        ("no such file or folder", ("store", "check", "{new}")),
        ("no such file or folder", ("store", "prune", "{new}", "--keep", "1")),
        ("holds no map", ("info", "{folder}")),
        ("cannot be opened", ("store", "versions", "nosuch://bucket/x")),
        ("cannot be read", ("store", "versions", "{scan}")),
        ("models of their own", ("fuse", "{drive}", "{fine}", "--out", "{new}")),
    ],
)
def test_refusals_end_with_2_and_leave_nothing(
    message: str, arguments: tuple[str, ...], built: Path, scans: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    fine = built.with_name("fine")
    if "{fine}" in arguments:
        assert run("build", scans[0], "--out", fine, "--resolution", "0.04", *FAST) == 0
    folder = built.with_name("folder")
    folder.mkdir()
    before = sorted(built.rglob("*"))
    new = built.with_name("new")
    names = {"scan": scans[0], "drive": built, "new": new, "folder": folder, "fine": fine}
    assert message in refused(capsys, *(argument.format(**names) for argument in arguments))
    assert not new.exists()
    assert list(folder.iterdir()) == []
    assert [p for p in sorted(built.rglob("*")) if p.name != "writers.lock"] == [
        p for p in before if p.name != "writers.lock"
    ]


def test_scans_without_labels_make_no_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = cloud(0)
    np.savez(tmp_path / "bare.npz", points=plain.points, names=np.array(CLASSES.names), labels=np.full(300, -1))
    error = refused(capsys, "build", tmp_path / "bare.npz", "--out", tmp_path / "drive", *FAST)
    assert "no scan has a label" in error


def test_urls_are_said_as_they_are_given() -> None:
    assert named(Path("s3://maps/drive")) == "s3://maps/drive"
    assert named(Path("maps/drive")) == "maps/drive"
