"""Help and errors come at once: what takes seconds to import is imported where it is used."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_manners import ALL

HEAVY = ("numba", "scipy", "numpy")

REPORT = """
import sys
from semgp.cli import main
try:
    main(sys.argv[2:])
finally:
    heavy = sys.argv[1].split(",")
    print("imported:", *(name for name in heavy if name in sys.modules), file=sys.stderr)
"""


def imported(*arguments: object) -> list[str]:
    """Return which of the heavy packages a command has imported by its end, in an interpreter of its own."""
    command = [sys.executable, "-c", REPORT, ",".join(HEAVY), *map(str, arguments)]
    process = subprocess.run(command, capture_output=True, text=True)
    last = process.stderr.splitlines()[-1]
    assert last.startswith("imported:"), process.stderr
    return last.split()[1:]


def test_the_list_of_commands() -> None:
    assert imported("--help") == []


@pytest.mark.parametrize("name", sorted({name[0] for name in ALL}))
def test_the_help_of_a_command(name: str) -> None:
    assert imported(name, "--help") == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("info", "absent.semgp"),
        ("query", "absent.semgp", "--out", "out.ply", "--resolution", "1"),
        ("build", "absent.ply", "--out", "map.semgp"),
        ("evaluate", "absent.semgp", "--truth", "absent.ply"),
        ("export", "absent.semgp", "--out", "map.ply", "--no-such-option"),
    ],
    ids=lambda arguments: arguments[0],
)
def test_bad_input(arguments: tuple[str, ...], tmp_path: Path) -> None:
    assert imported(*(tmp_path / part if part.startswith("absent") else part for part in arguments)) == []


def test_the_check_finds_what_it_looks_for(scan: Path) -> None:
    assert set(imported("build", scan, "--out", scan.with_name("map.semgp"), "--quiet")) == set(HEAVY)
