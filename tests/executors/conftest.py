"""One Ray cluster for the tests of a module."""

import warnings
from collections.abc import Iterator
from importlib.util import find_spec

import pytest

from semgp.executors import Executor, Threads, open_executor


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
