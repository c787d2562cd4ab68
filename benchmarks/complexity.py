"""How costs grow (paper, section VI): GP training with n_t points, n_u of them inducing; OctoMap with n_p points.

    uv run benchmarks/complexity.py [--json FILE] [--plot FILE.png]

The paper states O(n_t n_u^2) for training with FITC. Here that is one evaluation of NLML and gradient, the step
that learning repeats, for the two most frequent classes of a synthetic room. The OctoMap takes in one cloud, rays
included. An exponent is the slope of log seconds over log size at the three largest sizes, where the leading term
shows.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits

from semgp.cloud import LabelledCloud
from semgp.gp.fitc import FITCCovariance
from semgp.gp.inducing import inducing_points
from semgp.gp.likelihoods import Probit
from semgp.gp.one_vs_rest import class_posteriors, nlml_gradient
from semgp.gp.stationary import Matern52
from semgp.octomap import SemanticOctoMap
from semgp.scene.scan import synthetic_room
from semgp.scene.sensor import DepthCamera

TRAINING, FIXED_INDUCING = (2000, 4000, 8000, 16000, 32000), 200
INDUCING, FIXED_TRAINING = (100, 200, 400, 800, 1600), 4000
POINTS, RESOLUTION = (10_000, 20_000, 40_000, 80_000, 160_000, 300_000), 0.05
CLASSES = 2
REPEATS = 2
AT_THE_END = 3


@dataclass(frozen=True)
class Series:
    """Seconds at several sizes."""

    what: str
    symbol: str
    stated: str
    sizes: list[int]
    seconds: list[float]

    @property
    def exponent(self) -> float:
        """Slope of log seconds over log size at the largest sizes."""
        sizes, seconds = self.sizes[-AT_THE_END:], self.seconds[-AT_THE_END:]
        return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the measurements to this file")
    parser.add_argument("--plot", type=Path, help="write a plot to this file (.png, .pdf, .svg)")
    options = parser.parse_args()

    cloud = synthetic_room(camera=DepthCamera(width=640, height=480)).scan(0).truth
    cloud = cloud[np.random.default_rng(0).permutation(len(cloud))]
    with threadpool_limits(1, "blas"):  # classes are spread over threads; BLAS threads would fight them
        series = measure(cloud)
    show(series)
    if options.json:
        rows = [asdict(s) | {"exponent": s.exponent} for s in series]
        options.json.write_text(json.dumps(rows, indent=2))
    if options.plot:
        plot(series, options.plot)


def measure(cloud: LabelledCloud) -> list[Series]:
    return [
        Series(
            *(f"GP training, {FIXED_INDUCING} inducing", "n_t", "1", list(TRAINING)),
            [training_seconds(cloud, n, FIXED_INDUCING) for n in TRAINING],
        ),
        Series(
            *(f"GP training, {FIXED_TRAINING:,} points", "n_u", "2", list(INDUCING)),
            [training_seconds(cloud, FIXED_TRAINING, n) for n in INDUCING],
        ),
        Series(
            *(f"OctoMap, voxels of {100 * RESOLUTION:g} cm", "n_p", "1", list(POINTS)),
            [insertion_seconds(cloud, n) for n in POINTS],
        ),
    ]


def training_seconds(cloud: LabelledCloud, n_t: int, n_u: int) -> float:
    """Return the seconds of one evaluation of NLML and gradient."""
    part = cloud[:n_t]
    weights = part.class_weights.astype(np.float64)
    frequent = np.argsort(-weights.sum(axis=0))[:CLASSES]
    Y = 2 * weights[:, frequent] - 1
    m = np.full(CLASSES, -1.0)
    U = inducing_points(part.points, n_u)
    kernel = Matern52(ell=(0.3, 0.3, 0.3), sf=5.0)

    def evaluate() -> object:
        K = FITCCovariance(kernel, part.points, U)
        return nlml_gradient(K, class_posteriors(K, Probit(), Y, m))

    return best_of(evaluate)


def insertion_seconds(cloud: LabelledCloud, n_p: int) -> float:
    """Return the seconds in which an empty map takes in a cloud."""
    part = cloud[:n_p]
    return best_of(lambda: SemanticOctoMap(part.classes, RESOLUTION).update(part))


def best_of(work: Callable[[], object]) -> float:
    """Return the least wall-clock seconds of some runs; the first one may compile."""
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def show(series: list[Series]) -> None:
    table = Table("", "size", "seconds", "exponent", "paper", title="Measured growth of costs")
    for s in series:
        for size, seconds in zip(s.sizes, s.seconds):
            table.add_row(s.what, f"{s.symbol} = {size:,}", f"{seconds:.3f}")
        table.add_row("", "", "", f"{s.exponent:.2f}", s.stated, end_section=True)
    Console().print(table)


def plot(series: list[Series], path: Path) -> None:
    """Draw each series with its fitted line, all axes logarithmic."""
    canvas = Figure(figsize=(10, 3.4), dpi=200, layout="constrained")
    for s, axes in zip(series, canvas.subplots(1, len(series))):
        sizes, seconds = np.array(s.sizes, dtype=float), np.array(s.seconds)
        ends = sizes[[-AT_THE_END, -1]]
        middle = np.exp(np.log(seconds[-AT_THE_END:]).mean() - s.exponent * np.log(sizes[-AT_THE_END:]).mean())
        axes.loglog(ends, middle * ends**s.exponent, color="#c8553d", linewidth=4, alpha=0.35)
        axes.loglog(sizes, seconds, "o-", color="#3b6ea5", markersize=5, linewidth=1)
        axes.set_title(f"{s.what}\nseconds ~ ${s.symbol}^{{{s.exponent:.2f}}}$", fontsize=9)
        axes.set_xlabel(f"${s.symbol}$", fontsize=9)
        axes.set_xticks(sizes, [f"{size:,}" for size in s.sizes], fontsize=7)
        axes.set_ylim(10 ** np.floor(np.log10(seconds.min())), 10 ** np.ceil(np.log10(seconds.max())))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.tick_params(axis="y", labelsize=8)
        axes.minorticks_off()
        axes.grid(True, which="major", linewidth=0.4, color="#d9dce1")
    canvas.supylabel("seconds", fontsize=9)
    canvas.savefig(path)


if __name__ == "__main__":
    main()
