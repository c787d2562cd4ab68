"""Where the command line writes: results to standard output, progress and errors to standard error."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from semgp.errors import InputError
from semgp.writers import atomic_write

STDOUT = Console(width=None if sys.stdout.isatty() else 124)
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


HEADINGS = {
    **{"auc": "AUC", "miou": "mIoU", "nll": "NLL", "ece": "ECE", "brier": "Brier", "n_train": "labels"},
    **{"learn_seconds": "learn s", "fit_seconds": "fit s", "query_seconds": "query s", "peak_rss_mb": "MB"},
}


def score_table(title: str, rows: Sequence[dict[str, Any]], columns: Sequence[str]) -> Table:
    """Return a table of rows of scores, numbers to four digits, seconds to two, all else to whole numbers."""
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in columns:
        justify: Literal["left", "right"] = "left" if name in ("frame", "method") else "right"
        table.add_column(HEADINGS.get(name, name), justify=justify, no_wrap=True)
    for row, following in zip(rows, [*rows[1:], None], strict=True):
        means_follow = following is not None and row.get("frame") != following.get("frame") == "mean"
        table.add_row(*(_cell(name, row.get(name)) for name in columns), end_section=means_follow)
    return table


def _cell(name: str, value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float) and name not in ("n_train", "peak_rss_mb"):
        return f"{value:.2f}" if name.endswith("seconds") else f"{value:.4f}"
    return f"{value:,.0f}" if isinstance(value, int | float) else str(value)


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
