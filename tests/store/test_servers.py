"""Stores in buckets over the wire: a server that speaks S3, and connections that are lost."""

import itertools
import os
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from semgp.errors import ConflictError, FileFormatError, InputError
from semgp.executors import Threads
from semgp.parallel import parallel_map
from semgp.store import Manifest, MapStore, StoredMap, build, patience
from semgp.store.bucket import open_files
from semgp.store.fusing import fuse_stored
from tests.cli.test_commands import run
from tests.store.scenes import FREE, PLAIN, assert_same, cloud, in_memory, places, stored
from tests.store.servers import Wire, s3_server, s3_settings

pytest.importorskip("obstore", reason="buckets need the extra cloud")

CLOUDS = [cloud(i, 3.0 * i) for i in range(6)]
_numbers = itertools.count()


@pytest.fixture(scope="module")
def wire(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Wire]:
    """A wire to a server, and the environment for it."""
    with s3_server(tmp_path_factory.mktemp("server") / "log.txt") as port:
        wire = Wire(port)
        with mock.patch.dict(os.environ, s3_settings(wire.port), clear=True):
            yield wire
        wire.close()


@pytest.fixture
def place(wire: Wire) -> str:
    """A URL at which there is nothing yet."""
    wire.mend()
    return f"s3://maps/{next(_numbers)}/drive"


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patience, "PAUSES", (0.01,))


def test_the_life_of_a_map(place: str, tmp_path: Path) -> None:
    store = MapStore(place)
    store.create(FREE)
    build(store, CLOUDS[:4], Threads(2), batch=1)
    assert store.manifest().tiles == stored(tmp_path / "map", *CLOUDS[:4], settings=FREE).store.manifest().tiles
    with StoredMap(place) as opened:
        opened.update(CLOUDS[4])
    wanted = in_memory(FREE, *CLOUDS[:5])
    assert_same(StoredMap(place).query(places(1)), wanted.query(places(1)))
    low, high = (2, -5, -5), (9, 5, 5)
    assert_same(StoredMap(place).crop(low, high).query(places(1)), wanted.crop(low, high).query(places(1)))
    assert store.roll_back(3).number == 5
    assert StoredMap(place).clouds == 4
    open_files(place).create(f"tiles/{0:016x}-{'0' * 32}.npz", b"left by a writer that died")
    assert store.clean(older=3600) == 0
    assert store.clean() == 1
    store.prune(1)
    assert store.numbers() == [5]
    assert not list(store.check())


def test_commands_say_the_url_as_it_was_given(place: str, capsys: pytest.CaptureFixture[str]) -> None:
    with StoredMap.create(place, PLAIN) as made:
        made.update(CLOUDS[0])
    box = ("--low", "-99", "-99", "-99", "--high", "99", "99", "99")
    for command in (
        ("store", "check", place),
        ("store", "rollback", place, "--to", "2"),
        ("store", "prune", place, "--keep", "1"),
        ("store", "clean", place),
        ("info", place),
        ("crop", place, *box, "--out", f"{place}-part"),
        ("fuse", place, place, "--out", f"{place}-twice"),
    ):
        assert run(*command) == 0
        assert place in "".join(capsys.readouterr().out.split())


def test_fusing_into_another_bucket(place: str) -> None:
    for name, clouds in (("a", CLOUDS[:3]), ("b", CLOUDS[3:])):
        with StoredMap.create(f"{place}-{name}", PLAIN) as made:
            for one in clouds:
                made.update(one)
    out = place.replace("maps", "other")
    fuse_stored(StoredMap(f"{place}-a"), StoredMap(f"{place}-b"), out)
    assert_same(StoredMap(out).query(places(1)), in_memory(PLAIN, *CLOUDS).query(places(1)), 2e-6)


def test_one_of_many_writers_wins(place: str) -> None:
    files = [open_files(place) for _ in range(8)]
    for name in map(str, range(10)):
        assert sum(parallel_map(lambda one: one.create(name, b"the same"), files, 8)) == 1  # noqa: B023


def test_writers_at_once_add_up(place: str) -> None:
    with StoredMap.create(place, PLAIN) as made:
        made.update(CLOUDS[0])

    def write(i: int) -> None:
        for k in range(2):
            with StoredMap(place) as mine:
                mine.update(cloud(10 * i + k))

    parallel_map(write, range(1, 4), 3)
    clouds = [CLOUDS[0], *(cloud(10 * i + k) for i in range(1, 4) for k in range(2))]
    assert MapStore(place).manifest().clouds == len(clouds)
    assert_same(StoredMap(place).query(places(1)), in_memory(PLAIN, *clouds).query(places(1)))


def test_more_files_than_one_answer_lists(place: str) -> None:
    files = open_files(place)
    names = [f"{i:04d}" for i in range(1030)]
    parallel_map(lambda name: files.create(f"tiles/{name}", b""), names, files.at_once)
    files.create("tiles/below/1", b"")
    assert files.names("tiles") == names
    assert files.names("manifests") == []


class TestLostConnections:
    def test_a_short_loss_is_waited_for(self, wire: Wire, place: str, tmp_path: Path) -> None:
        store = MapStore(place)
        store.create(PLAIN)

        def lose() -> None:
            wire.cut()
            threading.Timer(0.4, wire.mend).start()

        manifest = build(store, CLOUDS, Threads(2), batch=1, steps=_once(lose))
        assert manifest.tiles == stored(tmp_path / "map", *CLOUDS).store.manifest().tiles

    @pytest.mark.usefixtures("impatient")
    def test_a_long_one_ends_the_build_which_can_go_on(self, wire: Wire, place: str, tmp_path: Path) -> None:
        store = MapStore(place)
        store.create(PLAIN)
        seen = _Lost(CLOUDS, 3, wire)
        with pytest.raises(InputError, match=f"{place}.*the server cannot be reached.*--resume"):
            build(store, seen, Threads(1), batch=2)
        with pytest.raises(FileFormatError, match="the server cannot be reached"):
            store.manifest()
        wire.mend()
        so_far = store.manifest()
        assert 0 < so_far.clouds < len(CLOUDS)
        assert not list(store.check())
        build(store, CLOUDS[so_far.clouds :], Threads(2))
        assert store.manifest().tiles == stored(tmp_path / "map", *CLOUDS).store.manifest().tiles

    def test_a_version_whose_answer_is_lost_is_ours(self, wire: Wire, place: str) -> None:
        store = MapStore(place)
        first = store.create(PLAIN)
        create = store.files.create

        def losing(name: str, data: bytes) -> bool:
            wire.swallow = 1
            return create(name, data)

        with mock.patch.object(store.files, "create", losing):
            assert store.publish(first) == store.manifest(2)
        assert wire.swallow == 0
        theirs, numbers = replace(first, note="of another writer"), mock.Mock(return_value=[1])
        with (
            mock.patch.multiple(store, numbers=numbers),
            mock.patch.object(store.files, "create", losing),
            pytest.raises(ConflictError),  # the bytes that are found there are others
        ):
            store.publish(theirs)


@pytest.mark.usefixtures("wire")
class TestWhatIsWrong:
    @pytest.mark.parametrize("ask", [MapStore.manifest, lambda store: store.create(PLAIN)], ids=["read", "write"])
    def test_a_bucket_that_is_not_there(self, ask: Callable[[MapStore], Manifest]) -> None:
        with pytest.raises(InputError, match=r"s3://nosuch/drive.*there is no such bucket"):
            ask(MapStore("s3://nosuch/drive"))

    def test_http_that_is_not_allowed(self, place: str, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("AWS_ALLOW_HTTP")
        with pytest.raises(FileFormatError, match="AWS_ALLOW_HTTP=true"):
            MapStore(place).manifest()


def _once(act: Callable[[], None]) -> Callable[[int], None]:
    """A step that acts when it is called first."""
    left = [act]

    def step(_: int) -> None:
        while left:
            left.pop()()

    return step


class _Lost(list[Any]):
    """Clouds, the connection cut where one of them is read."""

    def __init__(self, clouds: list[Any], at: int, wire: Wire) -> None:
        super().__init__(clouds)
        self._at, self._wire = at, wire

    def __getitem__(self, i: Any) -> Any:
        if i == self._at:
            self._wire.cut()
        return super().__getitem__(i)
