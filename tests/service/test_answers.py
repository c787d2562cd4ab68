"""What the service answers is what the map answers, however it is asked."""

import json
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from semgp.baselines.knn import KNNMap
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.files import load_map, save_map
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL
from semgp.service import Client
from semgp.service.answers import decode_answer
from semgp.store import Settings, StoredMap
from semgp.writers import write_npz
from tests.conftest import THREE
from tests.service.requests import (
    NPZ,
    RAW,
    asked,
    npy,
    part,
    post,
)
from tests.service.running import running


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


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_the_examples_of_the_documentation(store: Path, tmp_path: Path) -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "service.md").read_text()
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
