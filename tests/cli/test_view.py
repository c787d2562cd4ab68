"""`semgp view` as a user types it."""

import json
import re
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from tests.cli.test_commands import run


@pytest.fixture
def built(scan: Path) -> Path:
    out = scan.with_name("map.semgp")
    run("build", scan, "--out", out, "--resolution", "0.1", "--free-space", "--quiet")
    return out


def test_a_page(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = built.with_name("map.html")
    capsys.readouterr()
    assert run("view", built, "--html", out, "--hide", "wall", "--by", "entropy", "--json") == 0
    assert json.loads(capsys.readouterr().out)["bytes"] == out.stat().st_size
    text = out.read_text()
    assert "<title>map</title>" in text
    assert '"state": {"field": "entropy", "hidden": [1]}' in text


def test_a_server(built: Path, scan: Path) -> None:
    run("build", scan, "--kind", "octomap", "--out", built.with_name("octo.semgp"), "--quiet")
    beside = ["--cloud", scan, "--octomap", built.with_name("octo.semgp"), "--mesh"]
    command = ["view", built, "--port", "0", *beside]
    script = "import sys; from semgp.cli import main; main(sys.argv[1:])"
    with subprocess.Popen(
        [sys.executable, "-c", script, *map(str, command)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        url = re.search(r"http://127\.0\.0\.1:\d+", line)
        assert url is not None, line
        with urllib.request.urlopen(url[0]) as answer:
            assert b"<html" in answer.read(2000)
        process.send_signal(2)  # Ctrl-C
        assert process.wait(30) == 0
        assert process.stdout.read() == ""


def test_bad_input(built: Path, scan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = built.with_name("map.html")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        for message, arguments in (
            ("give one map", (built, built)),
            ("is no map of semgp", (scan,)),
            ("no such file", (built.with_name("none.semgp"),)),
            ("the map alone", (built, "--html", out, "--cloud", scan)),
            ("no class is called 'sofa'", (built, "--html", out, "--hide", "sofa")),
            ("no field 'depth'", (built, "--html", out, "--by", "depth")),
            ("has no room", (built, "--html", out, "--megabytes", "0.01")),
            ("ends in .html", (built, "--html", out.with_suffix(".txt"))),
            ("cubes need an OctoMap", (built, "--octomap", built)),
            ("--model must be one of", (scan, "--play", "--model", "none")),
            ("finished map", (scan, "--play", "--mesh")),
            ("cannot listen", (built, "--port", taken.getsockname()[1])),
        ):
            assert run("view", *arguments) == 2, message
            assert message in capsys.readouterr().err
    assert not out.exists()
