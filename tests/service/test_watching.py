"""What other processes publish is taken up, while queries are answered."""

import multiprocessing
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from semgp.errors import InputError
from semgp.service import Client
from semgp.service.service import Service
from semgp.store import MapStore, StoredMap
from tests.service.requests import HTTP, asked, part, until
from tests.service.running import running


def update(store: Path, n: int) -> None:
    """Commit versions, from another process."""
    with StoredMap(store) as mine:
        for seed in range(n):
            mine.update(part(seed, 800))
            mine.commit()


@pytest.mark.parametrize("read_only", [True, False])
def test_versions_of_another_process_are_taken_up(read_only: bool, store: Path) -> None:
    X, answers, stop = asked(500), [], threading.Event()

    def ask(url: str) -> None:
        with Client(url) as client:
            while not stop.is_set():
                probability = client.query(X).probability
                answers.append((client.version, probability))

    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.service.test_watching"])
    other = context.Process(target=update, args=(store, 4))
    with running(store, poll=0.02, read_only=read_only) as (url, service), Client(url) as client:
        thread = threading.Thread(target=ask, args=(url,))
        thread.start()
        other.start()
        other.join()
        assert other.exitcode == 0
        until(lambda: client.info()["version"] == 6)
        assert "semgp_version 6\n" in HTTP.get(url + "/metrics").text
        np.testing.assert_array_equal(client.query(X).probability, StoredMap(store).query(X).probability)
        assert client.version == 6
        stop.set()
        thread.join()
        assert service.metrics.total("semgp_looks_total", result="newer") >= 1
    expected = {version: StoredMap(store, version).query(X).probability for version in {v for v, _ in answers}}
    for version, probability in answers:
        np.testing.assert_array_equal(probability, expected[version])


def test_where_nobody_looks_the_next_update_takes_up_what_others_have_made(store: Path) -> None:
    with running(store, poll=0) as (url, _), Client(url) as client:
        update(store, 2)
        time.sleep(0.1)
        assert client.info()["version"] == 2
        assert client.info()["clouds"] == 1
        assert client.update(part(7)) == 5
        assert client.info()["clouds"] == 4


def test_a_version_that_others_have_removed_is_not_missed(store: Path) -> None:
    with running(store, poll=0, read_only=True) as (url, _), Client(url) as client:
        update(store, 3)
        MapStore(store).prune(1)
        answer = client.query(asked())
        assert client.version == 5
    np.testing.assert_array_equal(answer.probability, StoredMap(store).query(asked()).probability)


def test_a_store_that_is_away_for_a_while(store: Path) -> None:
    with running(store, poll=0.01) as (url, service), Client(url) as client:
        before = client.query(asked())
        store.rename(store.with_name("away"))
        store.write_text("in the way")
        until(lambda: service.metrics.total("semgp_looks_total", result="failed"))
        np.testing.assert_array_equal(client.query(asked()).probability, before.probability)
        store.unlink()
        store.with_name("away").rename(store)
        update(store, 1)
        until(lambda: client.info()["version"] == 3)


@pytest.mark.parametrize("poll", [-1.0, float("nan"), float("inf")])
def test_times_that_cannot_be(poll: float, store: Path) -> None:
    with pytest.raises(InputError, match="newer versions"):
        Service(store, poll=poll)
