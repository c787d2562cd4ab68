"""How the block map grows: lidar scans of a town without end, one after the other, into one map.

    uv run python benchmarks/town.py [--json] [--points 20000000] [--stride 5] [--plot FILE]

Every `stride`-th scan of `SyntheticTown` (a metre of drive each) with its noisy labels is added to the map, which
is brought up to date after each, until so many points are in. Printed after each million points: milliseconds a
scan of update and solve, sites, bytes a site at rest and solved, the process's peak memory, and accuracy at the
last scan's points. The exponent is that of seconds = a * sites^b, both counted from the first quarter on, in which
scans come to touch a whole range of blocks: 1 is linear growth with mapped surface.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from semgp.evaluation.measure import peak_memory_mb
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.scene.town import SyntheticTown

REPORT_EVERY = 1_000_000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--points", type=int, default=20_000_000)
    parser.add_argument(
        "--stride", type=int, default=5, help="scans, and metres, from one that is added to the next"
    )
    parser.add_argument("--plot", type=Path, help="write a plot of the growth to this file")
    options = parser.parse_args()
    rows = drive(options.points, options.stride)
    sites, spent = np.array([r["sites"] for r in rows]), np.array([r["seconds so far"] for r in rows])
    full = len(rows) // 4  # until then, scans do not yet reach as far as the map
    exponent = (
        float(np.polyfit(np.log(sites[full:]), np.log(spent[full:]), 1)[0]) if len(rows) > 7 else float("nan")
    )
    if options.json:
        print(json.dumps({"rows": rows, "exponent": exponent}, indent=2))
    else:
        table = Table(title=f"a town: seconds ~ sites^{exponent:.2f}")
        for name in rows[0]:
            table.add_column(name, justify="right")
        for row in rows:
            table.add_row(*(f"{v:,.3f}" if isinstance(v, float) else f"{v:,}" for v in row.values()))
        Console(width=140).print(table)
    if options.plot:
        plot(options.plot, rows, exponent)


def drive(n_points: int, stride: int) -> list[dict[str, Any]]:
    """Map the town and return a row for each million points."""
    town = SyntheticTown()
    gp_map = GPSemanticMap(town.classes, OUTDOOR_LIDAR)
    rows: list[dict[str, Any]] = []
    added, scan, spent = 0, 0, 0.0
    recent: deque[float] = deque(maxlen=20)
    while added < n_points:
        seen = town.scan(scan)
        start = time.perf_counter()
        gp_map.update(seen.observed)
        gp_map.solve()
        recent.append(time.perf_counter() - start)
        spent += recent[-1]
        added, scan = added + len(seen.observed), scan + stride
        if added // REPORT_EVERY > len(rows):
            facts = gp_map.info()
            answer = gp_map.query(seen.truth.points)
            rows.append({
                "points": added, "sites": facts["sites"], "ms a scan": 1e3 * float(np.mean(recent)),
                "seconds so far": spent, "bytes a site": facts["bytes_a_site"],
                "solved bytes a site": facts["solved_bytes"] / facts["sites"], "process MB": peak_memory_mb(),
                "accuracy": float((answer.label == seen.truth.hard_labels).mean()),
                "of the labels": float((seen.observed.hard_labels == seen.truth.hard_labels).mean()),
            })  # fmt: skip
    return rows


def plot(path: Path, rows: list[dict[str, Any]], exponent: float) -> None:
    """Draw seconds and bytes against sites."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    sites = [row["sites"] / 1e6 for row in rows]
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
    axes[0].plot(sites, [row["seconds so far"] for row in rows], marker="o")
    axes[0].set(xlabel="million sites", ylabel="seconds of update and solve", title=f"time ~ sites^{exponent:.2f}")
    axes[1].plot(sites, [row["bytes a site"] for row in rows], marker="o", label="at rest")
    axes[1].plot(sites, [row["solved bytes a site"] for row in rows], marker="s", label="solved, in use")
    axes[1].set(xlabel="million sites", ylabel="bytes a site", ylim=(0, None), title="memory")
    axes[1].legend()
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
