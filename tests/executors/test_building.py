"""Builds by executors: the same tiles, byte for byte, whoever does the work and whoever dies."""

import os
import signal
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.executors import Executor, Threads
from semgp.store import MapStore, Settings, Tile, build
from semgp.store.asking import query
from tests.executors.pieces import CLOUDS, Slow, new_store
from tests.store import scenes

DEATHS = 3
OTHER = Classes(("sky",))


@pytest.fixture(scope="module", params=[scenes.PLAIN, scenes.FREE], ids=["labels", "free space"])
def settings(request: pytest.FixtureRequest) -> Settings:
    chosen: Settings = request.param
    return chosen


@pytest.fixture(scope="module")
def expected(settings: Settings, tmp_path_factory: pytest.TempPathFactory) -> Mapping[int, Tile]:
    """The tiles as the store's own map makes them."""
    place = tmp_path_factory.mktemp("expected") / "map"
    return scenes.stored(place, *CLOUDS, settings=settings).store.manifest().tiles


class TestTheSameTiles:
    @pytest.mark.parametrize("batch", [1, 3, 16])
    def test_whatever_the_executor_and_the_batch(
        self, executor: Executor, batch: int, settings: Settings, expected: Mapping[int, Tile], tmp_path: Path
    ) -> None:
        store, done = new_store(tmp_path / "map", settings), list[int]()
        manifest = build(store, CLOUDS, executor, batch=batch, steps=done.append)
        assert manifest.tiles == expected
        assert manifest.clouds == len(CLOUDS)
        assert manifest == store.manifest()
        assert sum(done) >= len(CLOUDS)
        assert not list(store.check())

    def test_whatever_the_order_of_clouds(
        self, executor: Executor, settings: Settings, expected: Mapping[int, Tile], tmp_path: Path
    ) -> None:
        order = [0, *(1 + np.random.default_rng(0).permutation(len(CLOUDS) - 1))]  # the first sets the origin
        store = new_store(tmp_path / "map", settings)
        assert build(store, [CLOUDS[i] for i in order], executor, batch=2).tiles == expected

    def test_a_store_named_by_a_relative_path(
        self, executor: Executor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        build(new_store(Path("map"), scenes.PLAIN), CLOUDS[:2], executor)
        assert not list(MapStore(tmp_path / "map").check())

    def test_clouds_that_are_refused(self, executor: Executor, tmp_path: Path) -> None:
        other = LabelledCloud(np.zeros((1, 3)), OTHER, np.zeros(1, dtype=np.int32))
        store = new_store(tmp_path / "map", scenes.PLAIN)
        with pytest.raises(InputError, match="classes"):
            build(store, [CLOUDS[0], other], executor)
        assert store.numbers() == [1]

    def test_answers(self, executor: Executor, tmp_path: Path) -> None:
        whole = scenes.stored(tmp_path / "map", *CLOUDS)
        X = scenes.places(0, 500)
        scenes.assert_same(query(whole.store, X, executor), whole.query(X), 2e-6)


class TestDeaths:
    def test_workers_killed_at_any_moment(
        self, ray_cluster: Executor, scans: tuple[Sequence[LabelledCloud], Settings], tmp_path: Path
    ) -> None:
        clouds, settings = scans
        undisturbed = build(new_store(tmp_path / "plain", settings), clouds, Threads(2)).tiles
        readers = tmp_path / "readers"
        readers.mkdir()
        store, stop, killed = new_store(tmp_path / "map", settings), threading.Event(), list[int]()
        killer = threading.Thread(target=_kill, args=(readers, stop, killed))
        killer.start()
        try:
            manifest = build(store, Slow(clouds, readers, 0.1), ray_cluster, batch=2)
        finally:
            stop.set()
            killer.join()
        assert len(killed) == DEATHS
        assert manifest.tiles == undisturbed
        assert not list(store.check())


def _kill(readers: Path, stop: threading.Event, killed: list[int]) -> None:
    """Kill some workers, one after the other, each some time after it has begun to read."""
    rng = np.random.default_rng(0)
    while len(killed) < DEATHS and not stop.wait(0.02):
        for sign in readers.iterdir():
            pid = int(sign.name.split("-")[0])
            sign.unlink()
            if pid == os.getpid() or pid in killed or not Path(f"/proc/{pid}").exists():
                continue
            time.sleep(rng.uniform(0, 0.3))
            os.kill(pid, signal.SIGKILL)
            killed.append(pid)
            break
