"""What tests of the service share: a small map, and requests and bodies."""

import io
import threading
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import httpx
import numpy as np

from semgp.cloud import LabelledCloud
from semgp.maps.presets import GENERAL
from semgp.service import Limits
from semgp.service.service import Service
from semgp.store import Settings, StoredMap
from tests.conftest import THREE

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


def npy(a: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, a)
    return stream.getvalue()


def npz(**arrays: np.ndarray) -> bytes:
    return zipped({f"{name}.npy": npy(array) for name, array in arrays.items()})


def zipped(files: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return stream.getvalue()


def post(url: str, body: bytes, media: str = NPY, path: str = "/query", **headers: str) -> httpx.Response:
    return HTTP.post(url + path, content=body, headers={"Content-Type": media, **headers})


def hold(service: Service, go_on: threading.Event) -> None:
    """Keep the reader busy until told to go on."""
    service.reader.ask(lambda _: go_on.wait(20))


def until(true: Callable[[], object]) -> None:
    """Wait for what comes true sooner or later."""
    for _ in range(3000):
        if true():
            return
        time.sleep(0.01)
    raise AssertionError("it has not come true.")


def refused(response: httpx.Response, status: int) -> str:
    assert response.status_code == status, response.text
    reason = response.json()["error"]
    assert isinstance(reason, str)
    assert reason
    return reason
