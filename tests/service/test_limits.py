"""Limits of the service: too much, too many, too slow."""

import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from semgp.service import Client, Limits, UnavailableError
from tests.service.requests import (
    HTTP,
    NPY,
    NPZ,
    RAW,
    asked,
    hold,
    npy,
    post,
    refused,
)
from tests.service.running import running


def test_limits(url: str) -> None:
    assert "2,000 points, but 1,000" in refused(post(url, npy(np.zeros((2000, 3)))), 413)
    assert "more than 100,000 bytes" in refused(post(url, bytes(200_000)), 413)
    assert "more than 5,000 bytes" in refused(post(url, b" " * 6000, "application/json"), 413)

    def endless() -> Iterator[bytes]:  # no Content-Length
        for _ in range(50):
            yield bytes(10_000)

    response = HTTP.post(url + "/query", content=endless(), headers={"Content-Type": NPY})
    assert "more than" in refused(response, 413)
    assert "npz" in refused(post(url, b"", "text/plain", "/update"), 415)
    assert NPY in refused(post(url, b"", ""), 415)
    assert "Accept" in refused(post(url, npy(np.zeros((1, 3))), Accept="text/html"), 406)
    assert "Content-Encoding" in refused(post(url, b"", NPY, **{"Content-Encoding": "gzip"}), 415)
    refused(HTTP.get(url + "/nope"), 404)
    refused(HTTP.get(url + "/query"), 405)
    assert "dtype" in refused(post(url, b"", RAW, "/query?dtype=float16"), 422)
    assert "wait" in refused(post(url, b"", NPZ, "/update?wait=perhaps"), 422)


def test_too_many_queries_are_sent_away(store: Path) -> None:
    with running(store, Limits(most_queries=1, seconds=20)) as (url, service):
        go_on = threading.Event()
        hold(service, go_on)
        first = threading.Thread(target=post, args=(url, npy(asked())))
        first.start()
        while not service.queries.taken:
            pass
        response = post(url, npy(asked()))
        assert "try again later" in refused(response, 503)
        assert response.headers["Retry-After"] == "1"
        with Client(url) as client, pytest.raises(UnavailableError, match="1 queries wait already"):
            client.query(asked())
        go_on.set()
        first.join()


def test_slow_answers_and_slow_bodies_end(store: Path) -> None:
    with running(store, Limits(seconds=0.3)) as (url, service):
        go_on = threading.Event()
        hold(service, go_on)
        assert "no answer within 0.3 s" in refused(post(url, npy(asked())), 503)
        go_on.set()
        with socket.create_connection(("127.0.0.1", int(url.rsplit(":", 1)[1])), timeout=20) as slow:
            slow.sendall(f"POST /query HTTP/1.1\r\nHost: localhost\r\nContent-Type: {NPY}\r\n".encode())
            slow.sendall(b"Content-Length: 100\r\n\r\nabc")
            assert slow.recv(1000).startswith(b"HTTP/1.1 408")
