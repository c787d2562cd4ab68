"""Timings, and tables of them in markdown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from semgp.evaluation.measure import timed


def best(work: Callable[[], Any], repeat: int) -> float:
    """Least seconds of some runs: whatever else the machine does only adds to them."""
    return min(timed(work)[1] for _ in range(repeat))


def table(title: str, rows: Sequence[dict[str, Any]]) -> None:
    """Print a table in markdown."""
    names = list(rows[0])
    print(f"\n{title}\n\n| {' | '.join(names)} |\n|{'---|' * len(names)}")
    for row in rows:
        print(
            "| " + " | ".join(f"{v:,.3g}" if isinstance(v, float) else f"{v}" for v in row.values()) + " |",
            flush=True,
        )
