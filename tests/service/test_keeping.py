"""Old versions that the service lets go of: its own, once nobody reads them, and while nobody else writes."""

import signal
import subprocess
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semgp.errors import InputError
from semgp.maps.presets import GENERAL
from semgp.service import Client, UnavailableError
from semgp.service.keeping import KEEP, Keeper, note, versions_to_keep
from semgp.service.metrics import Metrics
from semgp.service.reader import Reader
from semgp.service.service import Service
from semgp.store import Manifest, MapStore, Settings, StoredMap
from semgp.store.bucket import BucketFiles
from tests.cli.test_serve import serving
from tests.conftest import THREE
from tests.service.requests import asked, part, until
from tests.service.running import running

EMPTY = Settings(THREE, GENERAL)


def test_only_the_newest_of_its_own_versions_stay(store: Path) -> None:
    with running(store, keep=2, poll=0) as (url, service), Client(url) as client:
        assert client.info()["keep"] == 2
        for seed in range(1, 4):
            client.update(part(seed))
        with StoredMap(store) as other:
            other.update(part(4))
        for seed in range(5, 9):
            client.update(part(seed))
        answer = client.query(asked())
        client.update(part(9))
        client.update(part(10))  # by then the drop after the one before is done
        assert MapStore(store).numbers()[:3] == [1, 2, 6]  # made by others
    assert MapStore(store).numbers() == [1, 2, 6, 11, 12]
    assert service.metrics.total("semgp_versions_dropped_total") == 7
    assert len(list((store / "tiles").iterdir())) <= 5 * len(MapStore(store).manifest().tiles)
    assert [list(MapStore(store).check(n)) for n in (1, 2, 6, 11, 12)] == [[]] * 5
    with StoredMap.create(store.parent / "again", EMPTY) as again:
        for seed in range(9):
            again.update(part(seed))
    np.testing.assert_array_equal(answer.probability, again.query(asked()).probability)


def test_all_versions_stay_where_that_is_asked_for(store: Path) -> None:
    with running(store, keep=0) as (url, _), Client(url) as client:
        for seed in range(4):
            client.update(part(seed))
    assert MapStore(store).numbers() == [1, 2, 3, 4, 5, 6]


def test_while_others_write_nothing_is_dropped_and_then_it_is(store: Path) -> None:
    with running(store, keep=1, poll=0.05) as (url, service), Client(url) as client:
        other = StoredMap(store)
        other.update(part(1))
        for seed in (2, 3, 4):
            client.update(part(seed))
        until(lambda: service.metrics.total("semgp_drops_total", result="put off") >= 3)
        assert MapStore(store).numbers() == [1, 2, 3, 4, 5]
        assert other.commit() == 6
        until(lambda: MapStore(store).numbers() == [1, 2, 6])
        assert client.info()["clouds"] == 5
    assert list(MapStore(store).check()) == []


def test_what_is_looked_at_stays(store: Path) -> None:
    with running(store, keep=1, poll=0.05) as (url, service), Client(url) as client:
        client.update(part(1))
        with service.view() as (version, seen):
            for seed in (2, 3, 4):
                client.update(part(seed))
            until(lambda: MapStore(store).numbers() == [1, 2, 3, 6])
            assert version == 3
            assert seen.query(asked()).observed.any()
        until(lambda: MapStore(store).numbers() == [1, 2, 6])


def test_what_cannot_be_dropped_does_not_stop_updates(store: Path) -> None:
    with running(store, keep=1, poll=0) as (url, service), Client(url) as client:
        client.update(part(1))
        (store / "manifests" / "00000002.json").write_bytes(b"damaged")
        assert client.update(part(2)) == 4
        assert client.update(part(3)) == 5
        until(lambda: service.metrics.total("semgp_drops_total", result="failed"))
        assert client.update(part(4)) == 6
    assert list(MapStore(store).check()) == []


OWN, OTHERS = note(1), "by hand"


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    notes=st.lists(st.sampled_from([OWN, note(12), OTHERS, "1 cloud by the service, they say"]), min_size=1),
    keep=st.integers(0, 6),
    data=st.data(),
)
def test_what_stays_is_new_or_read_or_of_others(
    notes: list[str], keep: int, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    store = MapStore(tmp_path_factory.mktemp("map"))
    for number, words in enumerate(notes):
        store.publish(Manifest(number, EMPTY, ""), words)
    numbers = store.numbers()
    reader = SimpleNamespace(version=data.draw(st.sampled_from(numbers)))
    keeper = Keeper(store, cast(Reader, reader), Metrics(), keep)
    with keeper.reading() as read:
        reader.version = data.draw(st.sampled_from(numbers[read - 1 :]))
        for _ in range(2):
            keeper.drop()
            stay = {*numbers[-keep:], read, *range(reader.version, len(numbers) + 1)}
            stay |= {n for n in numbers if notes[n - 1] not in (OWN, note(12))}
            assert store.numbers() == sorted(stay)


def test_where_writers_cannot_be_seen_all_stay_unless_there_are_none(tmp_path: Path) -> None:
    memory = pytest.importorskip("obstore.store", reason="buckets need the extra cloud").MemoryStore()
    bucket, folder = MapStore("mem://drive", BucketFiles(memory, "mem://drive")), MapStore(tmp_path / "map")
    assert [versions_to_keep(folder, keep, False) for keep in (None, 7, 0)] == [KEEP, 7, 0]
    assert [versions_to_keep(bucket, keep, False) for keep in (None, 0)] == [0, 0]
    assert [versions_to_keep(bucket, keep, True) for keep in (None, 7, 0)] == [KEEP, 7, 0]
    with pytest.raises(InputError, match="only-writer"):
        versions_to_keep(bucket, 7, False)
    with pytest.raises(InputError, match="not -1"):
        versions_to_keep(folder, -1, False)


def test_a_service_that_is_read_only_writes_nothing(store: Path) -> None:
    (store / "writers.lock").unlink()
    service = Service(store, read_only=True, keep=1, poll=0.01)
    time.sleep(0.1)
    service.close()
    assert service.keep == 0
    assert {path.name for path in store.iterdir()} == {"manifests", "tiles"}


@pytest.mark.parametrize("seconds", [0.15, 0.4])
def test_a_service_that_is_killed_leaves_whole_versions(seconds: float, store: Path) -> None:
    with serving(store, "--keep", "1") as (url, process), Client(url) as client:
        threading.Timer(seconds, subprocess.Popen.send_signal, (process, signal.SIGKILL)).start()
        seed = told = 0
        with suppress(UnavailableError):
            while process.poll() is None:
                seed += 1
                told = client.update(part(seed)) or told
    after = MapStore(store)
    assert after.numbers()[:2] == [1, 2]
    assert after.numbers()[-1] >= told
    assert after.manifest().clouds in (seed, seed + 1)
    assert [error for n in after.numbers() for error in after.check(n)] == []
    with running(store, keep=1, poll=0) as (url, _), Client(url) as client:
        client.update(part(0))
    assert len(after.numbers()) == 3
    assert len(list((store / "tiles").iterdir())) <= 3 * len(after.manifest().tiles)
