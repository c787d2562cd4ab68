"""Where the command line writes: results to standard output, progress and errors to standard error."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from semgp.errors import InputError
from semgp.writers import atomic_write

STDOUT = Console(width=None if sys.stdout.isatty() else 120)
STDERR = Console(stderr=True)


@contextmanager
def progress(quiet: bool = False) -> Iterator[Progress]:
    """Show progress on standard error while the block runs; nothing where it is no terminal or `quiet`."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(24), TimeElapsedColumn())
    with Progress(*columns, console=STDERR, transient=True, disable=quiet or not STDERR.is_terminal) as bars:
        yield bars


def write_json(path: Path | None, value: Any) -> None:
    """Write a value as JSON: to a file, whole or not at all, or to standard output where the path is "-"."""
    if path is None:
        return
    text = json.dumps(value, indent=2, allow_nan=False) + "\n"
    if str(path) == "-":
        STDOUT.file.write(text)
        return
    with atomic_write(path) as temporary:
        temporary.write_text(text)


def score_table(title: str, rows: Sequence[dict[str, Any]], columns: Sequence[str]) -> Table:
    """Return a table of rows of scores, numbers to four digits, seconds to two."""
    table = Table(title=title, title_justify="left")
    for name in columns:
        heading = name.replace("_seconds", " s").replace("n_", "").replace("_", " ")
        table.add_column(heading, justify="left" if name in ("frame", "method") else "right")
    for row in rows:
        table.add_row(*(_cell(name, row.get(name)) for name in columns))
    return table


def _cell(name: str, value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.2f}" if name.endswith("seconds") else f"{value:.4f}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def require_folder(path: Path) -> Path:
    """Make a folder for output, its parents too, and return it.

    Raises
    ------
    InputError
        A file of that name is in the way.
    """
    if path.exists() and not path.is_dir():
        raise InputError(f"{path} is a file; give the name of a folder.")
    path.mkdir(parents=True, exist_ok=True)
    return path
