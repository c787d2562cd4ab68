"""Manners that all commands share: help, quiet, JSON, Ctrl-C, errors, and extras that are missing."""

import ast
import json
import os
import re
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.metadata import packages_distributions, requires
from pathlib import Path

import pytest
from cyclopts import App

from semgp.cli.app import app
from tests.cli.test_commands import run

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "semgp"


def commands(of: App = app, before: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the names of all commands that do something."""
    for name, command in of.resolved_commands().items():
        if name.startswith("-"):
            continue
        if command.default_command is not None:
            yield (*before, name)
        yield from commands(command, (*before, name))


ALL = sorted(commands())


def parameters(name: tuple[str, ...]) -> dict[str, str]:
    """Return what the help of a command says of each parameter, by its first name."""
    command = app
    for part in name:
        command = command[part]
    return {
        argument.name: (argument.parameter.help or "").strip()
        for argument in command.assemble_argument_collection(parse_docstring=True)
        if argument.parameter.show is not False and not argument.children
    }


@pytest.mark.parametrize("name", ALL, ids=" ".join)
class TestEveryCommand:
    def test_help_has_a_description_an_example_and_every_parameter(
        self, name: tuple[str, ...], capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert run(*name, "--help") == 0
        text = " ".join(capsys.readouterr().out.split())
        command = " ".join(["semgp", *name])
        description = re.search(rf"Usage: {command}[^.]*? (?=[A-Z][a-z])(.+?) Example: ", text)
        assert description is not None, "say in a sentence or two what it does, before the examples"
        assert description[1].rstrip().endswith(".")
        assert f"Example: {command} " in text
        undocumented = [parameter for parameter, words in parameters(name).items() if len(words) < 4]
        assert not undocumented

    def test_what_all_commands_take_stands_in_its_help(
        self, name: tuple[str, ...], capsys: pytest.CaptureFixture[str]
    ) -> None:
        run(*name, "--help")
        text = capsys.readouterr().out
        assert all(option in text for option in ("--quiet", "--verbose", "--json"))

    def test_an_unknown_option_is_told(self, name: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
        assert run(*name, "--surely-no-option") == 2
        assert "--surely-no-option" in capsys.readouterr().err


def test_the_list_of_commands_says_what_each_does() -> None:
    """In a process of its own: commands are imported when they are asked for."""
    script = "from semgp.cli import main; main(['--help'])"
    text = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    for name in {name[0] for name in ALL}:
        assert re.search(rf"│ {name} +[A-Z][\w,]+ ", text), f"{name} has no description"


def test_quiet_and_json(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "map [1].semgp"
    assert run("build", scan, "--out", out) == 0
    capsys.readouterr()
    mesh = ("slice", out, "--height", "0.5", "--resolution", "0.2", "--out", tmp_path / "slice [b].png")
    assert run(*mesh) == 0
    assert "slice [b].png: " in capsys.readouterr().out  # brackets are no markup
    assert run(*mesh, "--quiet") == 0
    assert capsys.readouterr() == ("", "")
    assert run(*mesh, "--json") == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["out"] == str(mesh[-1])
    assert captured.err == ""


def test_verbose_tells_times_and_causes(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "map.semgp"
    run("build", scan, "--out", out)
    capsys.readouterr()
    assert run("slice", out, "--height", "0.5", "--resolution", "0.2", "--out", tmp_path / "s.png", "-v") == 0
    assert re.search(r"asking the map: \d+\.\d\d s", capsys.readouterr().err)
    out.write_bytes(b"PK nonsense")
    assert run("info", out) == 2
    assert "Traceback" not in capsys.readouterr().err
    assert run("info", out, "--verbose") == 2
    error = capsys.readouterr().err
    assert "direct cause" in error
    assert "error: " in error.splitlines()[-1]


def test_a_file_that_cannot_be_written_is_an_error_in_a_line(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert run("build", scan, "--out", tmp_path / "map.semgp", "--quiet") == 2
    captured = capsys.readouterr()
    assert "No space left on device" in captured.err
    assert "Traceback" not in captured.err
    assert list(tmp_path.iterdir()) == [scan]


def test_ctrl_c_ends_with_130_and_says_what_is_kept(
    scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("semgp.maps.files.save_map", stop)
    monkeypatch.setattr("os.fsync", stop)
    assert run("build", scan, "--out", tmp_path / "map.semgp") == 130
    assert "interrupted: no file is left half written" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [scan]
    monkeypatch.setattr("semgp.evaluation.demo.demo_task", stop)
    assert run("demo", "--out", tmp_path / "demo") == 130
    assert "holds nothing yet" in " ".join(capsys.readouterr().err.split())


RENDER_AND_TELL = """
import sys
from semgp.cli import main
import semgp.picture

portrait = sys.modules["semgp.picture.portrait"]

def draw(*arguments, plain=portrait.portrait, **options):
    print("drawing", file=sys.stderr, flush=True)
    return plain(*arguments, **options)

portrait.portrait = draw
main(sys.argv[1:])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_a_real_ctrl_c_leaves_nothing_half_written(scan: Path, tmp_path: Path) -> None:
    built, out = tmp_path / "map.semgp", tmp_path / "turn.png"
    run("build", scan, "--out", built, "--quiet")
    before = sorted(tmp_path.iterdir())
    turn = ("render", built, "--orbit", "--frames", "100000", "--size", "64", "48", "--out", out)
    command = [sys.executable, "-c", RENDER_AND_TELL, *map(str, turn)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert process.stderr.readline() == "drawing\n"
    process.send_signal(signal.SIGINT)
    said, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "interrupted: " in errors
    assert said == ""
    assert sorted(tmp_path.iterdir()) == before


# Optional packages: each import is guarded by a MissingExtraError that names its extra.

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def _package(requirement: str) -> str:
    return re.split(r"[^\w.-]", requirement, maxsplit=1)[0].lower().replace("_", "-")


MODULES: dict[str, set[str]] = {}
for module, distributions in packages_distributions().items():
    for distribution in distributions:
        MODULES.setdefault(distribution.lower().replace("_", "-"), set()).add(module)
NEEDED = {module for r in PROJECT["dependencies"] for module in MODULES.get(_package(r), ())}
EXTRAS = set(PROJECT["optional-dependencies"])


def third_party(node: ast.stmt) -> set[str]:
    """Return the packages beyond the standard library and the dependencies that a statement imports."""
    if isinstance(node, ast.Import):
        roots = {alias.name.split(".")[0] for alias in node.names}
    elif isinstance(node, ast.ImportFrom) and not node.level:
        roots = {(node.module or "").split(".")[0]}
    else:
        return set()
    return roots - set(sys.stdlib_module_names) - NEEDED - {"semgp", ""}


def guarded(node: ast.Try) -> bool:
    """Return whether a try statement names the extra, or says what to install, when an import in it fails."""
    for handler in node.handlers:
        if isinstance(handler.type, ast.Name) and handler.type.id in ("ImportError", "ModuleNotFoundError"):
            for call in ast.walk(handler):
                name = getattr(call.func, "id", "") if isinstance(call, ast.Call) else ""
                if name == "InputError":
                    return True
                if isinstance(call, ast.Call) and name == "MissingExtraError":
                    named = {a.value for a in call.args[1:] if isinstance(a, ast.Constant)}
                    return bool(named & EXTRAS)
    return False


def imports(tree: ast.Module) -> Iterator[tuple[str, int, bool, bool]]:
    """Yield package, line, whether it is guarded and in a function, of all imports but those for type checkers."""

    def walk(node: ast.AST, safe: bool, inside: bool) -> Iterator[tuple[str, int, bool, bool]]:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            return
        if isinstance(node, ast.stmt):
            for package in third_party(node):
                yield package, node.lineno, safe, inside
        inside = inside or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        for field, value in ast.iter_fields(node):
            covered = safe or (isinstance(node, ast.Try) and field == "body" and guarded(node))
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from walk(child, covered, inside)

    return walk(tree, False, False)


@cache
def checked_in(folder: Path) -> set[str]:
    """Return the packages whose absence the modules of a folder or of the top one tell, and what comes along."""
    trees = (ast.parse(path.read_text()) for path in [*folder.glob("*.py"), *SOURCE.glob("*.py")])
    checked = {package for tree in trees for package, _, safe, _ in imports(tree) if safe}
    along = set()
    for distribution, modules in MODULES.items():
        if modules & checked:
            along |= {m for r in requires(distribution) or () for m in MODULES.get(_package(r), ())}
    return checked | along


@pytest.mark.parametrize("path", sorted(SOURCE.rglob("*.py")), ids=lambda p: str(p.relative_to(SOURCE)))
def test_optional_packages_are_named_when_they_are_missing(path: Path) -> None:
    known = checked_in(path.parent)
    for package, line, _, _ in imports(ast.parse(path.read_text())):
        assert package in known, f"{path.name}:{line}: {package} may be missing: raise MissingExtraError"


WITHOUT_EXTRAS = """
import importlib, sys
blocked, modules = (set(names.split(",")) for names in sys.argv[1:])

class Missing:
    def find_spec(self, name, *_):
        if name.split(".")[0] in blocked:
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Missing())
from semgp.cli.app import app
app.resolved_commands()
for name in sorted(modules):
    importlib.import_module(name)
"""


def test_all_commands_load_without_any_extra() -> None:
    """And so do all modules but those that import an extra at their top, which only functions import."""
    optional, modules = set(), []
    for path in SOURCE.rglob("*.py"):
        found = list(imports(ast.parse(path.read_text())))
        optional |= {package for package, _, _, _ in found}
        if all(inside for _, _, _, inside in found):
            modules.append(
                ".".join(path.relative_to(SOURCE.parent).with_suffix("").parts).removesuffix(".__init__")
            )
    assert {"h5py", "matplotlib", "skimage", "trimesh"} <= optional
    command = [sys.executable, "-c", WITHOUT_EXTRAS, ",".join(optional), ",".join(modules)]
    process = subprocess.run(command, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr


def test_the_walk_finds_what_it_looks_for() -> None:
    text = (
        "import trimesh\ndef f():\n    import h5py\ndef g():\n    try:\n        import matplotlib\n"
        "    except ImportError as error:\n        raise MissingExtraError('drawing', 'figures') from error\n"
        "def h():\n    import numpy, json\n"
    )
    assert list(imports(ast.parse(text))) == [
        ("trimesh", 1, False, False),
        ("h5py", 3, False, True),
        ("matplotlib", 6, True, True),
    ]
