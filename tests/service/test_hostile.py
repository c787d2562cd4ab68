"""Bodies and bytes that are no requests: refused, and never an error of the service."""

import contextlib
import socket
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semgp.service.clouds import encode_cloud
from tests.service.requests import (
    HTTP,
    NPY,
    NPZ,
    RAW,
    asked,
    npy,
    npz,
    part,
    post,
    refused,
    zipped,
)


def lying_bomb() -> bytes:
    """An npz file whose array claims a few bytes and unpacks to 30 MB."""
    data = zipped({"points.npy": npy(np.zeros((1 << 20, 3)))})
    size = (24 << 20) + 128
    assert data.count(size.to_bytes(4, "little")) == 2
    return data.replace(size.to_bytes(4, "little"), (200).to_bytes(4, "little"))


def header(text: str) -> bytes:
    data = text.encode("latin1")
    return b"\x93NUMPY\x01\x00" + len(data).to_bytes(2, "little") + data


BAD_POINTS = {
    "empty": b"",
    "cut short": npy(np.zeros((10, 3)))[:-5],
    "pickled": npy(np.array([[1, "a", None]], dtype=object)),
    "text": npy(np.array([["a", "b", "c"]])),
    "complex": npy(np.zeros((2, 3), dtype=complex)),
    "records": npy(np.zeros(3, dtype=[("x", "f8")])),
    "two columns": npy(np.zeros((10, 2))),
    "flat": npy(np.zeros(9)),
    "not finite": npy(np.array([[0, np.inf, 0]])),
    "huge shape": header("{'descr':'<f8','fortran_order':False,'shape':(999999999999,3)}"),
    "negative shape": header("{'descr':'<f8','fortran_order':False,'shape':(-1,3)}"),
    "nested header": header("-" * 9000 + "1"),
    "huge header": b"\x93NUMPY\x02\x00" + (1 << 20).to_bytes(4, "little") + b" " * 50_000,
    "old header": header("{'descr':'<f8','fortran_order':False,'shape':(1L,3)}") + bytes(24),
}


@pytest.mark.parametrize("case", BAD_POINTS)
def test_bad_points_are_refused(case: str, url: str) -> None:
    if case == "old header":
        assert post(url, BAD_POINTS[case]).status_code in (200, 400)  # numpy warns, an error in these tests
    else:
        refused(post(url, BAD_POINTS[case]), 400)


BAD_JSON = [
    *(b"", b"[1, 2]", b'{"points": 3}', b'{"points": [[1, 2]]}', b'{"points": [["1", "2", "3"]]}', b"[" * 4000),
    *(b'{"points": [[NaN, 0, 0]]}', b'{"points": [[1e999, 0, 0]]}', b'{"points": [[null, true, 0]]}', b"\xff\xfe"),
    *(b'{"points": [[1' + b"0" * 400 + b", 0, 0]]}", b'{"points": [[' + b"1" * 4500 + b", 0, 0]]}"),
]


@pytest.mark.parametrize("body", BAD_JSON, ids=range(len(BAD_JSON)))
def test_bad_json_is_refused(body: bytes, url: str) -> None:
    refused(post(url, body, "application/json"), 400)


BAD_CLOUDS = {
    "empty": b"",
    "cut short": encode_cloud(part(1))[:-40],
    "no points": npz(labels=np.zeros(3, dtype=int)),
    "labels out of range": npz(points=np.zeros((1, 3)), labels=np.array([7])),
    "too many labels": npz(points=np.zeros((1, 3)), labels=np.array([1, 1])),
    "pickled": npz(points=np.array([[None] * 3], dtype=object)),
    "not finite": npz(points=np.full((1, 3), np.nan), labels=np.array([1])),
    "far away": npz(points=np.full((1, 3), 5e6), labels=np.array([1])),
    "nested header": zipped({"points.npy": header("-" * 9000 + "1")}),
    "lying bomb": lying_bomb(),
    "lzma": zipped({"points.npy": npy(np.zeros((10, 3)))}, zipfile.ZIP_LZMA),
    "bzip2": zipped({"points.npy": npy(np.zeros((10, 3)))}, zipfile.ZIP_BZIP2),
    "bomb": zipped({"points.npy": npy(np.zeros((100_000, 3)))}),
}


@pytest.mark.parametrize("case", BAD_CLOUDS)
def test_bad_clouds_are_refused(case: str, url: str) -> None:
    reason = refused(post(url, BAD_CLOUDS[case], NPZ, "/update"), 400)
    assert "/tmp" not in reason
    assert reason.count("the body") <= 1


FUZZ = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@FUZZ
@given(st.binary(max_size=200), st.sampled_from([NPY, RAW, "application/json"]))
def test_random_queries_are_never_an_error_of_the_service(url: str, body: bytes, media: str) -> None:
    response = post(url, body, media)
    assert response.status_code == 200 or refused(response, 400)


@FUZZ
@given(st.sampled_from(["/query", "/update"]), st.data())
def test_damaged_bodies_are_never_an_error_of_the_service(url: str, path: str, data: st.DataObject) -> None:
    whole = npy(asked(5)) if path == "/query" else npz(points=asked(5) * 1e-3, labels=np.zeros(5, dtype=int))
    damaged = bytearray(whole[: data.draw(st.integers(0, len(whole)))])
    for _ in range(data.draw(st.integers(0, 3)) if damaged else 0):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    response = post(url, bytes(damaged), NPY if path == "/query" else NPZ, path)
    assert response.status_code == 200 or refused(response, 400)


@FUZZ
@given(st.binary(max_size=300))
def test_what_is_no_http_is_sent_away(url: str, sent: bytes) -> None:
    with socket.create_connection(("127.0.0.1", int(url.rsplit(":", 1)[1])), timeout=20) as connection:
        connection.sendall(sent)
        connection.shutdown(socket.SHUT_WR)
        assert not connection.recv(1000).startswith(b"HTTP/1.1 5")
    assert HTTP.get(url + "/healthz").status_code == 200


def test_huge_headers_are_refused(url: str) -> None:
    with socket.create_connection(("127.0.0.1", int(url.rsplit(":", 1)[1])), timeout=20) as connection:
        connection.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX-Large: ")
        sent = 0
        with contextlib.suppress(ConnectionError):  # refused in the middle
            while sent < 10_000_000:
                sent += connection.send(bytes(10_000))
        assert sent < 10_000_000
    assert HTTP.get(url + "/healthz").status_code == 200
