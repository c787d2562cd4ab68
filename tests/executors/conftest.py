"""One Ray cluster for the tests of a module, and what is built by it."""

import warnings
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

import pytest

from semgp.cloud import LabelledCloud
from semgp.executors import Executor, Threads, open_executor
from semgp.maps.free_space import FreeSpace
from semgp.maps.presets import OUTDOOR_LIDAR
from semgp.readers import open_scans
from semgp.store import Settings
from tests.executors.pieces import CLOUDS
from tests.store import scenes


@pytest.fixture(scope="module")
def ray_cluster() -> Iterator[Executor]:
    if find_spec("ray") is None:  # not imported here: the executor sets first what Ray reads as it is imported
        pytest.skip("ray is not installed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Ray's own, of its start
        cluster = open_executor("ray", workers=2)
    with cluster:
        yield cluster


@pytest.fixture(params=["one thread", "two threads", "ray"])
def executor(request: pytest.FixtureRequest) -> Executor:
    if request.param == "ray":
        cluster: Executor = request.getfixturevalue("ray_cluster")
        return cluster
    return Threads(1 if request.param == "one thread" else 2)


@pytest.fixture(scope="module")
def scans(request: pytest.FixtureRequest) -> tuple[Sequence[LabelledCloud], Settings]:
    """Ten SemanticKITTI scans where they are, else the street."""
    try:
        folder: Path = request.getfixturevalue("data_dir")
    except pytest.skip.Exception:
        return CLOUDS, scenes.FREE
    clouds = open_scans(folder / "semantickitti_08")[:10]
    return clouds, Settings(clouds[0].classes, OUTDOOR_LIDAR, FreeSpace(rays=2000))
