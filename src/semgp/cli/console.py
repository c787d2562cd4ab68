"""Where the command line writes: results to standard output, progress and errors to standard error."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rich.console import Console, RenderableType

from semgp.errors import InputError

if TYPE_CHECKING:
    from rich.progress import Progress
    from rich.table import Table

STDOUT = Console(width=None if sys.stdout.isatty() else 124)
STDERR = Console(stderr=True)


@dataclass
class Manners:
    """What the user asked of every command alike: see `semgp.cli.app`."""

    quiet: bool = False
    verbose: bool = False
    json: bool = False


MANNERS = Manners()


def behave(*, quiet: bool, verbose: bool, json: bool) -> None:
    """Take the user's wishes for the command that runs next."""
    MANNERS.quiet, MANNERS.verbose, MANNERS.json = quiet, verbose, json
    STDOUT.quiet = quiet or json


def report(words: RenderableType, **facts: Any) -> None:
    """Say what came out, once a command: words for people or, with --json, the facts as one JSON object.

    Parameters
    ----------
    words : str or another renderable of Rich
        One line, or tables of scores.
    **facts
        The same for programs: numbers, texts, paths, arrays, and lists and mappings of them.
    """
    if MANNERS.json:
        sys.stdout.write(json.dumps(_plain(facts), indent=2) + "\n")
    elif isinstance(words, str):
        STDOUT.print(words, markup=False, highlight=False, soft_wrap=True)
    else:
        STDOUT.print(words)


@contextmanager
def progress(quiet: bool = False) -> Iterator[Progress]:
    """Show progress on standard error while the block runs; nothing where it is no terminal or --quiet.

    With --verbose, the time that each task took is written afterwards.
    """
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from semgp.cli.pace import Pace

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(24), Pace(), TimeElapsedColumn())
    silent = quiet or MANNERS.quiet or not STDERR.is_terminal
    with Progress(*columns, console=STDERR, transient=True, disable=silent) as bars:
        yield bars
    if MANNERS.verbose:
        for task in bars.tasks:
            STDERR.print(f"{task.description}: {task.elapsed or 0:.2f} s", markup=False, highlight=False)


def counted(n: int, what: str) -> str:
    """Return a number of things in words: 1 scan, 1,200 scans."""
    return f"{n:,} {what}" + ("" if n == 1 else "es" if what.endswith("s") else "s")


@contextmanager
def keeping(say: Callable[[], str]) -> Iterator[None]:
    """Tell, after Ctrl-C in the block, what it leaves behind: `say` is asked for it then."""
    try:
        yield
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(say()) from stop


def _plain(value: Any) -> Any:
    """Return a value as JSON has it: paths as texts, arrays as lists, what is not finite as null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # an array, or a number of numpy's
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


HEADINGS = {
    **{"auc": "AUC", "miou": "mIoU", "nll": "NLL", "ece": "ECE", "brier": "Brier", "n_train": "labels"},
    **{"iou": "IoU", "probability": "p(true)"},
    **{"learn_seconds": "learn s", "fit_seconds": "fit s", "query_seconds": "query s", "peak_rss_mb": "MB"},
}


def score_table(title: str, rows: Sequence[dict[str, Any]], columns: Sequence[str]) -> Table:
    """Return a table of rows of scores, numbers to four digits, seconds to two, all else to whole numbers."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.caption_justify = "left"
    for name in columns:
        of_words = any(isinstance(row.get(name), str) for row in rows)
        justify: Literal["left", "right"] = "left" if of_words else "right"
        table.add_column(HEADINGS.get(name, name), justify=justify, no_wrap=True)
    for row, following in zip(rows, [*rows[1:], None], strict=True):
        means_follow = following is not None and row.get("frame") != following.get("frame") == "mean"
        table.add_row(*(_cell(name, row.get(name)) for name in columns), end_section=means_follow)
    return table


def _cell(name: str, value: Any) -> str:
    if value is None or value != value:  # NaN
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
