"""How the service bears load: clients that ask and clients that update, on the loopback of this machine.

    uv run python benchmarks/service.py [--minutes 0.5] [--clients 4] [--points 100000] [--updates 0.5] [--keep 20]
        [--json]

`semgp serve` is started on a new stored map of a road with 13 classes. Each client asks about a piece of the road
again and again; one more adds a scan so many times a second, over and over along the whole road. Printed: latency
at the client (median, 99 %), points a second, memory of the service and size of the store from beginning to end,
errors, versions seen. At the end some of the answers are compared, bit for bit, with those of the version that
they name, opened anew, where it is still there.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from typing import Any
from urllib.request import urlopen

import numpy as np

from semgp.blocks.arrays import F64
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import SemgpError
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.service import Client
from semgp.store import MapStore, Settings, StoredMap

CLASSES = Classes.numbered(13)
ROAD, WIDTH, PIECE = 200.0, 20.0, 30.0  # metres
SPOT_CHECKS = 12
LEAST, MOST = 0.05, 60.0  # minutes


@dataclass
class Seen:
    """What the clients have seen."""

    seconds: list[float] = field(default_factory=list)
    update_seconds: list[float] = field(default_factory=list)
    answers: list[tuple[int, int, str]] = field(default_factory=list)  # version, seed, digest
    errors: list[str] = field(default_factory=list)
    memory: list[float] = field(default_factory=list)  # MB
    disk: list[float] = field(default_factory=list)  # MB


def surface(rng: np.random.Generator, start: float, length: float, n: int) -> F64:
    """Points near the ground of a piece of the road."""
    along, across = rng.uniform(start, start + length, n), rng.uniform(0, WIDTH, n)
    return np.column_stack([along, across, 0.5 * np.sin(along / 9) + rng.normal(scale=0.03, size=n)])


def scan(number: int, n: int = 10_000) -> LabelledCloud:
    """The scan with a number: 13 strips of classes, one label in ten wrong."""
    rng = np.random.default_rng([1, number])
    X = surface(rng, 10.0 * (number % int(ROAD / 10)), PIECE, n)
    labels = (X[:, 1] * 13 / WIDTH + X[:, 0] / 10).astype(int) % 13
    wrong = rng.random(n) < 0.1
    labels[wrong] = rng.integers(0, 13, np.count_nonzero(wrong))
    return LabelledCloud(X, CLASSES, labels)


def question(seed: int, n: int) -> F64:
    """Points that a client asks about."""
    rng = np.random.default_rng([2, seed])
    return surface(rng, rng.uniform(0, ROAD), PIECE, n)


def digest(probability: np.ndarray) -> str:
    return sha256(np.ascontiguousarray(probability).tobytes()).hexdigest()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=0.5)
    parser.add_argument("--clients", type=int, default=4)
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--updates", type=float, default=0.5, help="a second")
    parser.add_argument("--keep", type=int, default=20, help="versions that stay, 0 for all")
    parser.add_argument("--json", action="store_true", help="print JSON instead of words")
    options = parser.parse_args()
    if not LEAST <= options.minutes <= MOST:
        parser.error(f"--minutes goes from {LEAST:g} to {MOST:g}")
    with TemporaryDirectory() as folder:
        store = Path(folder) / "road"
        with StoredMap.create(store, Settings(CLASSES, OUTDOOR_LIDAR)) as road:
            for number in range(int(ROAD / 10)):
                road.update(scan(number))
        seen, ended = load(store, options)
        result = summary(seen, options, store) | {"service said": ended}
    if options.json:
        print(json.dumps(result, indent=2))
    else:
        for name, value in result.items():
            print(f"{name:32} {value}")


def load(store: Path, options: argparse.Namespace) -> tuple[Seen, str]:
    """Start the service, put it under load, stop it with SIGTERM; return what was seen and its last words."""
    command = [
        sys.executable,
        "-c",
        "from semgp.cli import main; main()",
        "serve",
        str(store),
        "--port",
        "0",
        "--keep",
        str(options.keep),
        "--json",
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    lines: list[str] = []
    while not lines or lines[-1].strip() != "}":
        lines.append(process.stdout.readline())
    url = json.loads("".join(lines))["url"]
    seen, stop = Seen(), Event()
    end = time.monotonic() + 60 * options.minutes
    works: list[Callable[[], None]] = [
        lambda: watch(url, store, seen, stop),
        lambda: update(url, seen, stop, options),
    ]
    works += [lambda k=k: ask(url, seen, stop, k, options) for k in range(options.clients)]  # type: ignore[misc]
    with ThreadPoolExecutor(len(works)) as pool:
        running = [pool.submit(work) for work in works]
        stop.wait(end - time.monotonic())
        stop.set()
    for work in running:
        work.result()
    process.send_signal(signal.SIGTERM)
    words = process.communicate(timeout=120)[1].strip()
    return seen, f"exit {process.returncode}: {words}"


def ask(url: str, seen: Seen, stop: Event, client_number: int, options: argparse.Namespace) -> None:
    """Ask until told to stop."""
    with Client(url) as client:
        seed = client_number
        while not stop.is_set():
            X = question(seed, options.points)
            start = time.perf_counter()
            try:
                answer = client.query(X)
                seen.seconds.append(time.perf_counter() - start)
                assert client.version is not None
                seen.answers.append((client.version, seed, digest(answer.probability)))
            except SemgpError as error:
                seen.errors.append(str(error))
            seed += options.clients


def update(url: str, seen: Seen, stop: Event, options: argparse.Namespace) -> None:
    """Add scans, so many a second, until told to stop."""
    if options.updates <= 0:
        return
    with Client(url) as client:
        number = int(ROAD / 10)
        while not stop.is_set():
            start = time.perf_counter()
            try:
                client.update(scan(number))
                seen.update_seconds.append(time.perf_counter() - start)
            except SemgpError as error:
                seen.errors.append(str(error))
            number += 1
            stop.wait(max(0.0, 1 / options.updates - (time.perf_counter() - start)))


def watch(url: str, store: Path, seen: Seen, stop: Event) -> None:
    """Write down the memory of the service and the size of its store, every second."""
    while not stop.wait(1):
        with urlopen(url + "/metrics", timeout=60) as response:
            lines = response.read().decode().splitlines()
        seen.memory += [float(x.split()[1]) / 1e6 for x in lines if x.startswith("process_resident_memory_bytes ")]
        seen.disk.append(on_disk(store))


def on_disk(store: Path) -> float:
    """Megabytes of all files of a store, but for those that are removed meanwhile."""
    total = 0
    for path in store.rglob("*"):
        with suppress(FileNotFoundError):
            total += path.stat().st_size if path.is_file() else 0
    return total / 1e6


def summary(seen: Seen, options: argparse.Namespace, store: Path) -> dict[str, Any]:
    """Return the numbers, and what the spot checks found."""
    t, u = np.array(seen.seconds), np.array(seen.update_seconds)
    there = set(MapStore(store).numbers())
    answers = [answer for answer in seen.answers if answer[0] in there]
    chosen = [answers[i] for i in np.linspace(0, len(answers) - 1, SPOT_CHECKS).astype(int)] if answers else []
    alike = sum(
        digest(StoredMap(store, version).query(question(seed, options.points)).probability) == known
        for version, seed, known in chosen
    )
    memory, disk = (np.array_split(np.array(values), 4) for values in (seen.memory, seen.disk))
    return {
        "cores": len(os.sched_getaffinity(0)),
        "minutes": options.minutes,
        "clients": options.clients,
        "points a call": options.points,
        "calls answered": len(t),
        "points a second": round(len(t) * options.points / (60 * options.minutes)),
        "query p50 / p99 / worst, s": [round(float(v), 3) for v in (*np.quantile(t, [0.5, 0.99]), t.max())],
        "updates": len(u),
        "update p50 / p99, s": [round(float(v), 3) for v in np.quantile(u, [0.5, 0.99])] if len(u) else None,
        "versions seen": len({version for version, *_ in seen.answers}),
        "memory by quarters, MB (most)": [round(float(part.max())) for part in memory if len(part)],
        "on disk by quarters, MB (most)": [round(float(part.max()), 1) for part in disk if len(part)],
        "on disk at the end, bytes": round(1e6 * on_disk(store)),
        "versions at the end": len(there),
        "errors": len(seen.errors),
        "first errors": seen.errors[:3],
        "spot checks exact": f"{alike} of {len(chosen)}",
    }


if __name__ == "__main__":
    main()
