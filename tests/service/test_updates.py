"""Updates beside queries: every answer is of one version, and no cloud is lost."""

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import ConflictError, InputError
from semgp.service import Client, UnavailableError
from semgp.service.limits import BusyError
from semgp.service.service import Service
from semgp.store import StoredMap
from tests.conftest import THREE
from tests.service.requests import (
    HTTP,
    asked,
    hold,
    part,
)
from tests.service.running import running


def test_an_update_is_seen_by_the_next_query(store: Path) -> None:
    with running(store) as (url, _), Client(url) as client:
        before = client.query(asked())
        assert client.version == 2
        assert client.update(part(1, 2000)) == 3
        after = client.query(asked())
        assert client.version == 3
        assert client.update(part(2), wait=False) is None
    assert not np.array_equal(before.probability, after.probability)
    np.testing.assert_array_equal(after.probability, StoredMap(store, 3).query(asked()).probability)
    assert StoredMap(store).version == 4  # what waited was committed when the service ended
    assert StoredMap(store).info()["clouds"] == 3


def test_every_answer_is_of_one_version(store: Path) -> None:
    X, answers, stop = asked(2000), [], threading.Event()

    def ask(url: str) -> None:
        with Client(url) as client:
            while not stop.is_set():
                probability = client.query(X).probability
                answers.append((client.version, probability))

    with running(store) as (url, _), Client(url) as client:
        threads = [threading.Thread(target=ask, args=(url,)) for _ in range(3)]
        for thread in threads:
            thread.start()
        versions = [client.update(part(seed, 1000)) for seed in range(1, 5)]
        stop.set()
        for thread in threads:
            thread.join()
    assert versions == [3, 4, 5, 6]
    assert len(answers) > 5
    expected = {version: StoredMap(store, version).query(X).probability for version in {v for v, _ in answers}}
    assert len(expected) > 1
    for version, probability in answers:
        np.testing.assert_array_equal(probability, expected[version])


def test_other_writers_of_the_store_are_joined(store: Path) -> None:
    with running(store) as (url, _), Client(url) as client:
        client.update(part(1))
        with StoredMap(store) as other:
            other.update(part(2))
        assert client.update(part(3)) == 5
        assert client.info()["clouds"] == 4
        np.testing.assert_array_equal(
            client.query(asked()).probability, StoredMap(store).query(asked()).probability
        )


def test_a_refused_cloud_leaves_the_others_of_its_batch(store: Path) -> None:
    far = LabelledCloud(np.array([[5e6, 0.0, 0.0]]), THREE, np.array([0]))
    with running(store) as (url, service):
        writer = service.writer
        assert writer is not None
        futures = [writer.update(cloud) for cloud in (part(1), far, part(2))]
        assert futures[0].result(60) <= futures[2].result(60)
        with pytest.raises(InputError, match="drop stray points"):
            futures[1].result(60)
        assert 'semgp_updates_total{result="refused"} 1' in HTTP.get(url + "/metrics").text
    assert StoredMap(store).info()["clouds"] == 3


def test_a_store_that_fails_is_told_and_then_goes_on(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise InputError("cannot write: no space left on device.")

    with running(store) as (url, service), Client(url) as client:
        with monkeypatch.context() as patched:
            patched.setattr("semgp.store.store.MapStore.add", full)
            with pytest.raises(InputError, match="no space left"):
                client.update(part(1))
        assert client.update(part(2)) == 3
        assert service.metrics.total("semgp_updates_total", result="failed") == 1
    assert StoredMap(store).info()["clouds"] == 2


def test_a_faster_writer_makes_it_try_again(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commit, conflicts = StoredMap.commit, [3]

    def contested(stored: StoredMap, *arguments: Any) -> int:
        if conflicts[0]:
            conflicts[0] -= 1
            raise ConflictError("another writer was faster.")
        return commit(stored, *arguments)

    monkeypatch.setattr(StoredMap, "commit", contested)
    with running(store) as (url, _), Client(url) as client:
        assert client.update(part(1)) == 3
        conflicts[0] = 1000
        with pytest.raises(UnavailableError, match="another writer was faster"):
            client.update(part(2))
        conflicts[0] = 0
        assert client.update(part(3)) == 4
    assert StoredMap(store).info()["clouds"] == 3


def test_updates_that_wait_are_committed_or_dropped(store: Path) -> None:
    for drop, clouds in ((True, 2), (False, 5)):
        service, go_on = Service(store), threading.Event()
        assert service.writer is not None
        hold(service, go_on)
        futures = [service.writer.update(part(1))]
        while service.writer.waiting:  # the first is taken in, and waits for the reader
            pass
        futures += [service.writer.update(part(seed)) for seed in (2, 3)]
        threading.Timer(0.2, go_on.set).start()
        assert service.close(drop=drop) == (2 if drop else 0)
        assert futures[0].result() > 2
        assert [f.exception() is None for f in futures[1:]] == [not drop, not drop]
        assert StoredMap(store).info()["clouds"] == clouds
        with pytest.raises(BusyError, match="shutting down"):
            service.writer.update(part(4))
        assert not service.is_ready
