"""Counts of what a service has done, in Prometheus' text format (version 0.0.4)."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from threading import Lock

BUCKETS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)
"""Upper bounds of a histogram's buckets, seconds."""

HELP = {
    "semgp_requests_total": "Requests by path and status.",
    "semgp_request_seconds": "Time from a request's head to the end of its answer.",
    "semgp_points_total": "Points that were asked about and answered.",
    "semgp_updates_total": "Clouds by what became of them: committed, refused, failed or dropped.",
    "semgp_refresh_seconds": "Time for which queries waited for the reader to take up a version.",
    "semgp_looks_total": "Looks for versions that others have made: newer (and taken up) or failed.",
    "semgp_drops_total": "Goes at dropping old versions: done, put off (others write) or failed.",
    "semgp_versions_dropped_total": "Old versions that were dropped.",
    "semgp_version": "The version that queries are answered from.",
    "semgp_queries_in_flight": "Queries that are read, wait, or are answered.",
    "semgp_updates_waiting": "Clouds that wait for the writer.",
    "process_resident_memory_bytes": "Memory of the process.",
}

Labels = tuple[tuple[str, str], ...]


class Metrics:
    """Counters and histograms; any thread may count."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._counts: dict[str, dict[Labels, float]] = defaultdict(lambda: defaultdict(float))
        self._times: dict[str, dict[Labels, list[float]]] = defaultdict(dict)

    def count(self, name: str, amount: float = 1, **labels: str) -> None:
        """Add to a counter."""
        with self._lock:
            self._counts[name][tuple(labels.items())] += amount

    def time(self, name: str, seconds: float, **labels: str) -> None:
        """Add to a histogram."""
        with self._lock:
            row = self._times[name].setdefault(tuple(labels.items()), [0.0] * (len(BUCKETS) + 2))
            for i, bound in enumerate(BUCKETS):
                row[i] += seconds <= bound
            row[-2] += 1
            row[-1] += seconds

    def total(self, name: str, **labels: str) -> int:
        """Return the sum of a counter over all labels that agree with those given."""
        with self._lock:
            rows = self._counts[name].items()
            return int(sum(value for have, value in rows if set(labels.items()) <= set(have)))

    def text(self, gauges: dict[str, float]) -> str:
        """Return everything as text, with gauges as they are now."""
        lines: list[str] = []
        with self._lock:
            for name, counts in self._counts.items():
                lines += _heading(name, "counter")
                lines += [f"{name}{_labels(labels)} {value:.10g}" for labels, value in counts.items()]
            for name, times in self._times.items():
                lines += _heading(name, "histogram")
                for labels, (*below, count, total) in times.items():
                    for bound, value in zip((*map(str, BUCKETS), "+Inf"), (*below, count)):
                        lines.append(f"{name}_bucket{_labels((*labels, ('le', bound)))} {value:.10g}")
                    lines.append(f"{name}_sum{_labels(labels)} {total:.10g}")
                    lines.append(f"{name}_count{_labels(labels)} {count:.10g}")
        for name, value in gauges.items():
            lines += [*_heading(name, "gauge"), f"{name} {value:.10g}"]
        return "\n".join([*lines, ""])


def resident_bytes() -> float | None:
    """Return the memory of this process in bytes; None where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return None
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


def _heading(name: str, kind: str) -> list[str]:
    return [f"# HELP {name} {HELP[name]}", f"# TYPE {name} {kind}"]


def _labels(labels: Iterable[tuple[str, str]]) -> str:
    inside = ",".join(f'{name}="{_escaped(value)}"' for name, value in labels)
    return f"{{{inside}}}" if inside else ""


def _escaped(value: str) -> str:
    return value.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")
