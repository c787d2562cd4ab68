"""Killed writers; `benchmarks/store_crashes.py` kills hundreds, here are some."""

import json
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
from itertools import count
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from semgp.store import MapStore, StoredMap
from tests.store.scenes import assert_same, places

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "store_crashes.py"
KILLS = int(os.environ.get("SEMGP_KILLS", "24"))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_maps_survive_writers_that_are_killed_at_any_moment() -> None:
    command = [sys.executable, str(BENCHMARK), "--kills", str(KILLS), "--seed", "1", "--json"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    outcome = json.loads(ended.stdout)
    assert sum(writer["kills"] for writer in outcome.values()) == KILLS
    for writer in outcome.values():
        assert writer["left_partial"] + writer["left_orphans"] > 0  # some were killed at work


def drop_and_die(place: Path, n: int) -> None:
    """Drop all versions but the newest, and be killed right before the n-th file is removed."""
    numbers, unlink = count(1), Path.unlink

    def deadly(path: Path, **options: Any) -> None:
        if next(numbers) == n:
            os.kill(os.getpid(), signal.SIGKILL)
        unlink(path, **options)

    with mock.patch.object(Path, "unlink", deadly):
        MapStore(place).drop(range(1, 5))


def test_whoever_is_killed_while_dropping_leaves_whole_versions(five: MapStore, tmp_path: Path) -> None:
    answer = StoredMap(five).query(places(1))
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.store.test_crashes"])
    for n in count(1):
        store = MapStore(shutil.copytree(five.location, tmp_path / str(n)))
        process = context.Process(target=drop_and_die, args=(tmp_path / str(n), n))
        process.start()
        process.join()
        assert [error for number in store.numbers() for error in store.check(number)] == []
        assert store.numbers()[-1] == 5
        assert_same(StoredMap(store).query(places(1)), answer)
        store.tidy()  # as the next writer does
        listed = {tile.name(key) for m in map(store.manifest, store.numbers()) for key, tile in m.tiles.items()}
        assert {path.name for path in (tmp_path / str(n) / "tiles").iterdir()} == listed
        if process.exitcode == 0:
            break
        assert process.exitcode == -signal.SIGKILL
    assert n > 6
    assert store.numbers() == [5]
