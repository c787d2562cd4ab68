"""The one-way walk of imports is a contract (see .importlinter)."""

from pathlib import Path

from importlinter.cli import lint_imports


def test_imports_go_one_way() -> None:
    config = Path(__file__).resolve().parents[1] / ".importlinter"
    assert lint_imports(str(config), no_cache=True) == 0
