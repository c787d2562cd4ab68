"""`semgp serve` as a process of its own: how it starts, says where it is, and ends."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.presets import GENERAL
from semgp.service import Client
from semgp.store import Settings, StoredMap
from tests.cli.test_commands import run
from tests.conftest import THREE

SERVE = (sys.executable, "-W", "error", "-c", "from semgp.cli import main; main()", "serve")
TOKEN = "correct-horse-battery-staple"


@pytest.fixture
def store(corner: LabelledCloud, tmp_path: Path) -> Path:
    with StoredMap.create(tmp_path / "store", Settings(THREE, GENERAL)) as stored:
        stored.update(corner)
    return tmp_path / "store"


@contextmanager
def serving(*arguments: object) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Start `semgp serve --json`; yield its URL and process."""
    process = subprocess.Popen(
        [*SERVE, *map(str, arguments), "--port", "0", "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        said = ""
        while not said.endswith("}\n") and process.poll() is None:
            said += process.stdout.readline()
        yield json.loads(said)["url"], process
    finally:
        process.kill()
        process.communicate()


def stopped(process: subprocess.Popen[str], how: signal.Signals) -> tuple[int, str]:
    process.send_signal(how)
    words = process.communicate(timeout=60)[1]
    return process.returncode, words


def test_sigterm_commits_what_waits(store: Path, corner: LabelledCloud) -> None:
    with serving(store) as (url, process), Client(url) as client:
        assert len(client.query(corner.points[:10])) == 10
        for _ in range(5):
            client.update(corner, wait=False)
        status, words = stopped(process, signal.SIGTERM)
    assert status == 0
    assert "answered 10 points, committed 5 updates" in words
    assert StoredMap(store).info()["clouds"] == 6


def test_ctrl_c_ends_with_130_and_a_file_has_the_token(store: Path, corner: LabelledCloud, tmp_path: Path) -> None:
    (tmp_path / "token").write_text(TOKEN + "\n")
    with serving(store, "--token-file", tmp_path / "token") as (url, process):
        with Client(url) as client, pytest.raises(InputError, match="token"):
            client.info()
        with Client(url, TOKEN) as client:
            assert client.update(corner) == 3
        status, words = stopped(process, signal.SIGINT)
    assert status == 130
    assert words.startswith("interrupted: answered 0 points, committed 1 updates")
    assert "Traceback" not in words


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--host", "0.0.0.0"), "give a token"),
        (("--port", "99999"), "port is a number"),
        (("--host", "192.0.2.1", "--token-file", "TOKEN"), "cannot listen on 192.0.2.1"),
        (("--timeout", "0"), "seconds must be positive"),
        (("--keep", "-1"), "0 for all of them, not -1"),
        (("--poll", "-1"), "never (0), not -1"),
        (("--token-file", "none.txt"), "none.txt"),
    ],
)
def test_what_cannot_be_served(
    arguments: tuple[str, ...], words: str, store: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "TOKEN").write_text(TOKEN)
    given = [tmp_path / a if a == "TOKEN" else a for a in arguments]
    assert run("serve", store, *given) == 2
    assert words in capsys.readouterr().err.replace("\n", " ")


def test_nothing_to_serve(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("serve", tmp_path) == 2
    assert "holds no map" in capsys.readouterr().err


def test_the_token_of_the_environment(
    store: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SEMGP_TOKEN", "short")
    assert run("serve", store) == 2
    assert "16 printable" in capsys.readouterr().err


def test_without_the_extra(
    store: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "fastapi", None)
    assert run("serve", store) == 2
    assert "semgp[serve]" in capsys.readouterr().err
