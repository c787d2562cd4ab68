"""Killed writers: what a stored map is after kill -9 at any moment.

    uv run python benchmarks/store_crashes.py [--kills 300] [--data FOLDER] [--seed 0] [--json]

Processes that write a map of SemanticKITTI 08, or of a synthetic street without `--data`, are killed: half of them
after a random time, half right before a random one of their calls that sync, name or remove a file. They write by
`StoredMap.update` and `commit`, spilling tiles all the time, or the same and old versions are dropped on the way,
or by `semgp.store.build`. After each kill all tiles of all versions are read, and the newest must be, file by
file, what an undisturbed writer has after as many clouds, and not older than what the dead one was told was
committed. What a dead writer leaves behind must be gone when the next one has begun. Writers go on until the map
is whole. Exit code 1 if anything was otherwise.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.store import MapStore, StoredMap
from store_writers import (
    KEPT,
    Tell,
    Tiles,
    by_build,
    by_updates,
    by_updates_that_drop,
    pieces,
    street,
    undisturbed,
)

LIVES = 6  # a writer lives for a sixth of a map on average

Write = Callable[[Path, Sequence[LabelledCloud], Tell], None]
WRITERS: tuple[Write, ...] = (by_updates, by_updates_that_drop, by_build)


@dataclass
class Outcome:
    """What the killed writers of one kind have left."""

    kills: int = 0
    maps: int = 0
    versions: int = 0
    left_partial: int = 0
    left_orphans: int = 0
    empty: int = 0
    seconds: float = 0.0


class BrokenError(Exception):
    """A store is not as it must be."""


def die_before(n: int) -> None:
    """Have this process killed right before its n-th call that syncs, names or removes a file."""
    left = [n]

    def deadly(call: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*args: Any, **kwargs: Any) -> Any:
            left[0] -= 1
            if left[0] <= 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return call(*args, **kwargs)

        return counted

    os.fsync, os.link, os.unlink = deadly(os.fsync), deadly(os.link), deadly(os.unlink)
    Path.unlink = deadly(Path.unlink)  # type: ignore[method-assign]


def killed(work: Callable[[Tell], None], seconds: float | None, calls: int | None) -> tuple[bool, int]:
    """Run work in a child that is killed after some time or calls; tell whether it was, and what it told last."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(read)
            if calls is not None:
                die_before(calls)
            work(lambda clouds: os.write(write, clouds.to_bytes(4, "little")))
            code = 0
        finally:
            os._exit(code)
    os.close(write)
    end = time.monotonic() + (60 if seconds is None else seconds)
    done, status = os.waitpid(child, os.WNOHANG)
    while not done and time.monotonic() < end:
        time.sleep(0.001)
        done, status = os.waitpid(child, os.WNOHANG)
    if not done:
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
    with os.fdopen(read, "rb") as pipe:
        told = pipe.read()
    if os.WIFEXITED(status) and os.WEXITSTATUS(status):
        raise BrokenError("a writer failed: see its message above.")
    return os.WIFSIGNALED(status), int.from_bytes(told[-4:], "little")


def left_over(place: Path) -> tuple[int, int]:
    """Files half written, and whole ones that no version lists."""
    store = MapStore(place)
    listed = {tile.name(key) for n in store.numbers() for key, tile in store.manifest(n).tiles.items()}
    names = {path.name for path in place.glob("*/*")}
    half = {name for name in names if name.startswith(".")}
    orphans = {path.name for path in place.glob("tiles/*")} - listed - half
    return len(half), len(orphans)


def inspect(place: Path, wanted: dict[int, Tiles], told: int, drops: bool) -> int:
    """Return how many clouds a map has, after comparing all that it is with what it should be."""
    store = MapStore(place)
    numbers = store.numbers()
    if not numbers:
        return 0
    if numbers != list(range(numbers[0] if drops else 1, numbers[-1] + 1)):
        raise BrokenError(f"versions {numbers}")
    newest = store.manifest()
    if newest.clouds < told:
        raise BrokenError(f"{told} clouds were committed, {newest.clouds} are there")
    if newest.tiles != wanted[newest.clouds]:
        raise BrokenError(f"version {newest.number} is not that of {newest.clouds} clouds")
    for number in numbers:
        if damaged := list(store.check(number)):
            raise BrokenError(f"version {number}: {damaged[0]}")
    if newest.tiles:
        stored = StoredMap(store)
        stored.query(stored.positions[:50])
    return newest.clouds


def trial(
    write: Write, clouds: Sequence[LabelledCloud], wanted: dict[int, Tiles], kills: int, folder: Path, seed: int
) -> Outcome:
    """Write map after map by writers that are killed."""
    rng, outcome, begin = np.random.default_rng(seed), Outcome(), time.monotonic()
    drops = write is by_updates_that_drop
    place = folder / f"{write.__name__}-undisturbed"
    killed(partial(write, place, clouds), None, None)
    life = (time.monotonic() - begin) / LIVES
    files = sum(1 for _ in place.glob("*/*"))
    if MapStore(place).manifest().tiles != wanted[len(clouds)]:
        raise BrokenError(f"{write.__name__} makes another map")
    place, clouds_before, told = folder / f"{write.__name__}-0", 0, 0
    while outcome.kills < kills:
        timed = rng.random() < 0.5
        seconds = rng.exponential(life) if timed else None
        calls = None if timed else 1 + int(rng.exponential(4 * files / LIVES))
        was_killed, last = killed(partial(write, place, clouds), seconds, calls)
        told = max(told, last)
        now = inspect(place, wanted, told, drops)
        if now < clouds_before:
            raise BrokenError(f"{clouds_before} clouds were there, {now} are left")
        half, orphans = left_over(place)
        outcome.empty += now == 0
        outcome.left_partial += half > 0
        outcome.left_orphans += orphans > 0
        outcome.kills += was_killed
        if rng.random() < 0.5 or not was_killed:
            with MapStore(place).writing():
                if left_over(place) != (0, 0):
                    raise BrokenError(f"a writer has begun, and {left_over(place)} files are still there")
        clouds_before = now
        if not was_killed:
            if now != len(clouds):
                raise BrokenError(f"a writer ended well, and the map has {now} clouds")
            if drops and len(MapStore(place).numbers()) > KEPT + 1:  # the last one came after the last drop
                raise BrokenError(f"versions {MapStore(place).numbers()} are left")
            outcome.maps, outcome.versions = outcome.maps + 1, outcome.versions + len(MapStore(place).numbers())
            place, clouds_before, told = folder / f"{write.__name__}-{outcome.maps}", 0, 0
    outcome.seconds = time.monotonic() - begin
    return outcome


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=300, help="how many writers are killed")
    parser.add_argument("--data", type=Path, help="folder of SemanticKITTI 08; left out, a synthetic street")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if options.kills < len(WRITERS):
        parser.error(f"--kills must be {len(WRITERS)} at least")
    try:
        clouds = street(20) if options.data is None else pieces(options.data)
    except InputError as error:
        parser.error(str(error))
    outcomes: dict[str, Outcome] = {}
    with TemporaryDirectory() as folder:
        wanted = undisturbed(Path(folder) / "undisturbed", clouds)
        for i, write in enumerate(WRITERS):
            kills = (options.kills + i) // len(WRITERS)
            try:
                outcomes[write.__name__] = trial(write, clouds, wanted, kills, Path(folder), options.seed)
            except BrokenError as error:
                sys.exit(f"{write.__name__}: {error}")
    if options.json:
        print(json.dumps({name: asdict(outcome) for name, outcome in outcomes.items()}))
        return
    print(f"{len(clouds)} clouds, {sum(map(len, clouds)):,} points, {len(wanted[len(clouds)])} tiles")
    for name, o in outcomes.items():
        print(f"{name}: {o.kills} kills in {o.seconds:.0f} s, {o.maps} maps completed, {o.versions} versions")
        print(f"  half-written files after {o.left_partial}, files of no version after {o.left_orphans}, ", end="")
        print(f"nothing committed yet after {o.empty}")
    print("After each kill the newest version was that of an undisturbed writer, and all versions were whole;")
    print("leftovers were gone with the next writer.")


if __name__ == "__main__":
    main()
