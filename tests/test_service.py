"""The service over real connections: what it answers, refuses and keeps consistent."""

import base64
import contextlib
import io
import json
import re
import shlex
import shutil
import socket
import subprocess
import sys
import threading
import zipfile
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semgp.baselines.knn import KNNMap
from semgp.cloud import LabelledCloud
from semgp.errors import ConflictError, InputError, MissingExtraError
from semgp.maps.files import load_map, save_map
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.service import Client, Limits, UnavailableError
from semgp.service.answers import decode_answer
from semgp.service.clouds import encode_cloud
from semgp.service.limits import BusyError
from semgp.service.metrics import Metrics
from semgp.service.server import serve
from semgp.service.service import Service
from semgp.store import Settings, StoredMap
from semgp.writers import write_npz
from tests.conftest import THREE
from tests.service_running import running

NPY, NPZ, RAW = "application/x-npy", "application/x-npz", "application/octet-stream"
TOKEN = "correct-horse-battery-staple"
HTTP = httpx.Client(verify=False, timeout=60)  # its own defaults read certificates with every call
SMALL = Limits(most_points=1000, most_bytes=100_000, most_json_bytes=5000, seconds=20)


def part(seed: int, n: int = 300) -> LabelledCloud:
    """A scan of a floor that changes its classes from seed to seed."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(0, 2, (n, 2)), rng.normal(scale=0.01, size=n)])
    return LabelledCloud(points, THREE, ((points[:, 0] * 2).astype(int) + seed) % 3)


def asked(n: int = 50) -> np.ndarray:
    return np.random.default_rng(9).uniform((0, 0, -0.05), (2, 2, 0.05), (n, 3))


def new_store(folder: Path) -> Path:
    store = folder / "store"
    with StoredMap.create(store, Settings(THREE, GENERAL)) as stored:
        stored.update(part(0))
    return store


@pytest.fixture(scope="module", autouse=True)
def _closed() -> Iterator[None]:
    with HTTP:
        yield


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return new_store(tmp_path)


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """One small-limited service for the tests that change nothing that others see."""
    with running(new_store(tmp_path_factory.mktemp("map")), SMALL) as (url, _):
        yield url


def npy(a: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, a)
    return stream.getvalue()


def npz(**arrays: np.ndarray) -> bytes:
    return zipped({f"{name}.npy": npy(array) for name, array in arrays.items()})


def post(url: str, body: bytes, media: str = NPY, path: str = "/query", **headers: str) -> httpx.Response:
    return HTTP.post(url + path, content=body, headers={"Content-Type": media, **headers})


def hold(service: Service, go_on: threading.Event) -> None:
    """Keep the reader busy until told to go on."""
    service.reader.ask(lambda _: go_on.wait(20))


def refused(response: httpx.Response, status: int) -> str:
    assert response.status_code == status, response.text
    reason = response.json()["error"]
    assert isinstance(reason, str)
    assert reason
    return reason


def test_all_bodies_mean_the_same(store: Path) -> None:
    X = asked().astype(np.float32)
    expected = StoredMap(store).query(X)
    with running(store) as (url, _):
        answers = {
            "npy": post(url, npy(X)),
            "float32": post(url, X.astype("<f4").tobytes(), RAW, Accept=NPZ),
            "float64": post(url, X.astype("<f8").tobytes(), RAW, "/query?dtype=float64", Accept=NPZ),
            "json": post(url, json.dumps({"points": X.tolist()}).encode(), "application/json", Accept=NPZ),
        }
        raw = post(url, X.tobytes(), RAW)
        plain = post(url, json.dumps({"points": X.tolist()}).encode(), "application/json").json()
    for answer in answers.values():
        assert answer.headers["X-Semgp-Version"] == "2"
        got = decode_answer(answer.content)
        np.testing.assert_array_equal(got.probability, expected.probability)
        np.testing.assert_array_equal(got.variance, expected.variance)
        np.testing.assert_array_equal(got.observed, expected.observed)
        assert got.classes == THREE
    assert raw.headers["X-Semgp-Columns"] == "probability:3,variance:1,observed:1"
    rows = np.frombuffer(raw.content, "<f4").reshape(len(X), 5)
    np.testing.assert_array_equal(rows[:, :3], expected.probability)
    np.testing.assert_array_equal(rows[:, 4], expected.observed)
    assert plain["label"] == expected.label.tolist()
    np.testing.assert_allclose(plain["probability"], expected.probability)


def test_client_of_a_map_with_free_space(corner: LabelledCloud, tmp_path: Path) -> None:
    gp_map = GPSemanticMap(THREE, free=FreeSpace())
    gp_map.update(corner)
    save_map(gp_map, tmp_path / "map.semgp")
    X = np.vstack([corner.points[::7], [[1, 0, 1], [40, 0, 0]]])
    expected = load_map(tmp_path / "map.semgp").query(X)
    with running(tmp_path / "map.semgp") as (url, _), Client(url) as client:
        got, info = client.query(X), client.info()
        assert len(client.query(np.empty((0, 3)))) == 0
        with pytest.raises(InputError, match=r"single file.*read-only: build"):
            client.update(corner)
    assert got.occupancy is not None
    assert expected.occupancy is not None
    np.testing.assert_array_equal(got.probability, expected.probability)
    np.testing.assert_array_equal(got.occupancy.probability, expected.occupancy.probability)
    np.testing.assert_array_equal(got.occupancy.known, expected.occupancy.known)
    assert info["classes"] == list(THREE.names)
    assert info["read_only"]


def test_maps_of_other_kinds(corner: LabelledCloud, tmp_path: Path) -> None:
    knn = KNNMap(THREE)
    knn.update(corner)
    save_map(knn, tmp_path / "map.semgp")
    with running(tmp_path / "map.semgp") as (url, _), Client(url) as client:
        np.testing.assert_array_equal(
            client.query(corner.points).probability, knn.query(corner.points).probability
        )
        assert client.version == 1


def test_utm_coordinates_keep_their_millimetres(tmp_path: Path) -> None:
    shift = np.array([500_000.0, 5_400_000.0, 300.0])
    cloud = part(0)
    far = LabelledCloud(cloud.points + shift, THREE, cloud.labels)
    with StoredMap.create(tmp_path / "far", Settings(THREE, GENERAL)) as stored:
        stored.update(far)
    with running(tmp_path / "far") as (url, _), Client(url) as client:
        np.testing.assert_array_equal(
            client.query(asked() + shift).probability,
            StoredMap(tmp_path / "far").query(asked() + shift).probability,
        )


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
            patched.setattr("semgp.store.store.MapStore.publish", full)
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


def test_a_server_that_is_no_service_is_told_apart() -> None:
    class Page(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"<html>")

        do_POST = do_GET

        def log_message(self, *_: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Page) as server:
        threading.Thread(target=server.serve_forever).start()
        with Client(f"http://127.0.0.1:{server.server_port}") as client:
            with pytest.raises(UnavailableError, match="no answer"):
                client.info()
            with pytest.raises(UnavailableError, match="no answer"):
                client.query(asked())
        server.shutdown()


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


def test_token(store: Path) -> None:
    with running(store, token=TOKEN) as (url, _):
        assert "Bearer" in refused(HTTP.get(url + "/info"), 401)
        for wrong in ("Bearer wrong", "Bearer", "Basic !!", "Basic " + base64.b64encode(b"me:no").decode(), "?"):
            refused(HTTP.get(url + "/", headers={"Authorization": wrong}), 401)
        for right in (f"Bearer {TOKEN}", "Basic " + base64.b64encode(f"me:{TOKEN}".encode()).decode()):
            assert HTTP.get(url + "/info", headers={"Authorization": right}).status_code == 200
        assert HTTP.get(url + "/info", headers={"Host": "map.example", "Authorization": right}).status_code == 200
        assert HTTP.get(url + "/healthz").json() == {"status": "ok"}
        assert HTTP.get(url + "/readyz").json() == {"status": "ready"}
        with Client(url, TOKEN) as client:
            assert len(client.query(asked())) == 50
        with Client(url) as client, pytest.raises(InputError, match="token"):
            client.info()


def test_other_machines_need_a_token(store: Path) -> None:
    with pytest.raises(InputError, match="give a token"):
        serve(Service(store), host="0.0.0.0", port=0)
    with pytest.raises(InputError, match="16 printable"):
        serve(Service(store), port=0, token="short")


def test_names_of_other_machines_are_not_answered(url: str) -> None:
    assert "this machine" in refused(HTTP.get(url + "/info", headers={"Host": "evil.example"}), 421)
    for host in ("localhost", "127.0.0.1:80", "[::1]:8000"):
        assert HTTP.get(url + "/info", headers={"Host": host}).status_code == 200


def test_read_only(store: Path) -> None:
    with running(store, read_only=True) as (url, _):
        assert "--read-only" in refused(post(url, encode_cloud(part(1)), NPZ, "/update"), 409)


def test_the_client_says_what_is_wrong(url: str) -> None:
    with Client(url) as client:
        with pytest.raises(InputError, match="NaN or infinite"):
            client.query([[np.nan, 0, 0]])
        with pytest.raises(InputError, match="shape"):
            client.query([1, 2, 3])
        with pytest.raises(InputError, match="are not the map's"):
            client.update(LabelledCloud(np.zeros((1, 3)), type(THREE)(("a", "b")), np.zeros(1, dtype=int)))
        connection = client._connection.sock
        client.info()
        assert client._connection.sock is connection  # kept
        assert connection is not None
        connection.shutdown(socket.SHUT_RDWR)
        assert client.info()["classes"] == list(THREE.names)  # opened again
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with Client(f"http://127.0.0.1:{port}") as client, pytest.raises(UnavailableError, match="cannot be reached"):
        client.info()
    for bad in ("ftp://a", "localhost:8000", ""):
        with pytest.raises(InputError, match="no URL"):
            Client(bad)


def test_pages_load_nothing_from_elsewhere(store: Path) -> None:
    with running(store) as (url, _):
        docs = HTTP.get(url + "/docs")
        assert "POST /query" in docs.text
        assert "default-src 'none'" in docs.headers["Content-Security-Policy"]
        assert "in the making" in HTTP.get(url + "/").text
        while "X-Semgp-Version" not in (page := HTTP.get(url + "/")).headers:
            pass
        assert "<canvas" in page.text
        assert len(page.content) < 4_000_000
        for text in (docs.text, page.text):
            assert not any(f'{start}="http' in text for start in ("src", "href"))
        schema = HTTP.get(url + "/openapi.json").json()
        assert set(schema["paths"]) == {"/query", "/update", "/info", "/healthz", "/readyz", "/metrics"}


def test_metrics_are_prometheus_text(url: str) -> None:
    post(url, npy(asked()))
    text = HTTP.get(url + "/metrics").text
    assert 'semgp_requests_total{path="/query",status="200"}' in text
    samples = [line for line in text.splitlines() if not line.startswith("#")]
    assert all(float(line.rsplit(" ", 1)[1]) >= 0 for line in samples)
    assert any(line.startswith("process_resident_memory_bytes") for line in samples) or sys.platform != "linux"


def test_histograms_are_cumulative_and_labels_escaped() -> None:
    metrics = Metrics()
    for seconds in (0.001, 0.02, 99):
        metrics.time("semgp_request_seconds", seconds, path='a"b\\c\n')
    lines = metrics.text({}).splitlines()
    assert r'semgp_request_seconds_bucket{path="a\"b\\c\n",le="0.025"} 2' in lines
    assert r'semgp_request_seconds_bucket{path="a\"b\\c\n",le="+Inf"} 3' in lines
    assert r'semgp_request_seconds_sum{path="a\"b\\c\n"} 99.021' in lines


@pytest.mark.parametrize("missing", ["fastapi", "uvicorn"])
def test_without_the_extra(missing: str, store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(MissingExtraError, match=r"semgp\[serve\]"):
        serve(Service(store), port=0)


def zipped(files: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return stream.getvalue()


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


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_the_examples_of_the_documentation(store: Path, tmp_path: Path) -> None:
    text = (Path(__file__).resolve().parents[1] / "docs" / "service.md").read_text()
    examples = re.findall(r"^curl http://127.0.0.1:8000.*$", text, re.MULTILINE)
    assert len(examples) > 4
    np.save(tmp_path / "points.npy", asked())
    asked().astype("<f4").tofile(tmp_path / "points.f32")
    write_npz(tmp_path / "scan.npz", part(1))
    with running(store) as (url, _):
        for example in examples:
            command = shlex.split(example.replace("http://127.0.0.1:8000", url))
            subprocess.run([*command, "--fail", "--silent", "--show-error"], cwd=tmp_path, check=True, timeout=60)
    assert len(decode_answer((tmp_path / "answer.npz").read_bytes())) == 50
    assert (tmp_path / "answer.f32").stat().st_size == 50 * 5 * 4
    assert StoredMap(store).version == 3


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
