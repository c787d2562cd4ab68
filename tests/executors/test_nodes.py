"""Builds on a Ray cluster of several nodes, each with its own objects: one dies, the tiles are the same."""

import os
import shutil
import signal
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from semgp.cloud import LabelledCloud
from semgp.executors import Executor, Threads, open_executor
from semgp.executors.ray import ALONE, EVERYWHERE
from semgp.store import Settings, Tile, build
from tests.executors.pieces import Slow, new_store
from tests.store.servers import s3_server, s3_settings

N = 5
SOON = {"health_check_initial_delay_ms": 2000, "health_check_period_ms": 1000, "health_check_failure_threshold": 3}
"""When a node counts as dead: after 15 seconds by default."""


@dataclass
class Nodes:
    """A head without cores, which the tests are connected to, and two nodes of one core."""

    cluster: Any
    workers: list[Any] = field(default_factory=list)

    def fill(self) -> None:
        """Have two nodes of one core."""
        while len(self.workers) < 2:
            self.workers.append(self.cluster.add_node(num_cpus=1, object_store_memory=200 << 20))

    def kill_one(self) -> None:
        """Kill all processes of a node at once, and with them what it has computed."""
        node = self.workers.pop()
        raylet = node.all_processes["raylet"][0].process.pid
        children = Path(f"/proc/{raylet}/task/{raylet}/children").read_text().split()
        for pid in (raylet, *map(int, children)):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.cluster.remove_node(node, allow_graceful=False)


@pytest.fixture(scope="module")
def bucket(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str | None]:
    """The URL of a bucket that the nodes reach, too, where there is a server."""
    if shutil.which("moto_server") is None or find_spec("obstore") is None:
        yield None
        return
    log = tmp_path_factory.mktemp("server") / "log.txt"
    with s3_server(log) as port, mock.patch.dict(os.environ, s3_settings(port), clear=True):
        yield "s3://maps"


@pytest.fixture(scope="module")
def nodes(bucket: str | None) -> Iterator[Nodes]:
    """A cluster on loopback, its environment with the bucket's settings."""
    if find_spec("ray") is None or not Path("/proc/self/task").is_dir():
        pytest.skip("ray is not installed, or processes cannot be found here")
    os.environ.update(EVERYWHERE | ALONE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Ray's own, of its start
        from ray.cluster_utils import Cluster

        head = {
            "num_cpus": 0,
            "include_dashboard": False,
            "object_store_memory": 200 << 20,
            "_system_config": SOON,
        }
        cluster: Any = Cluster(initialize_head=True, head_node_args=head)
        try:
            made = Nodes(cluster)
            made.fill()
            yield made
        finally:
            cluster.shutdown()


@pytest.fixture
def executor(nodes: Nodes) -> Iterator[Executor]:
    nodes.fill()
    with open_executor("ray", address=nodes.cluster.address) as joined:
        yield joined


@pytest.fixture(scope="module")
def undisturbed(
    scans: tuple[Sequence[LabelledCloud], Settings], tmp_path_factory: pytest.TempPathFactory
) -> Mapping[int, Tile]:
    """The tiles by threads."""
    store = new_store(tmp_path_factory.mktemp("plain") / "map", scans[1])
    return build(store, scans[0][:N], Threads(2)).tiles


@pytest.mark.parametrize("place", ["folder", "bucket"])
def test_a_node_that_dies(
    place: str,
    nodes: Nodes,
    bucket: str | None,
    executor: Executor,
    scans: tuple[Sequence[LabelledCloud], Settings],
    undisturbed: Mapping[int, Tile],
    tmp_path: Path,
) -> None:
    """In the folder's build it dies at work, in the bucket's once all sums are there, many of them on it."""
    clouds, settings = scans[0][:N], scans[1]
    if place == "bucket" and bucket is None:
        pytest.skip("moto_server is not installed: pip install 'moto[s3]' flask flask-cors")
    assert executor.n_workers == 2
    store = new_store(tmp_path / "map" if place == "folder" else f"{bucket}/map", settings)
    readers = tmp_path / "readers"
    readers.mkdir()
    kill = _at(1 if place == "folder" else len(clouds), nodes.kill_one)
    manifest = build(store, Slow(clouds, readers, 0.1), executor, steps=kill)
    assert len(nodes.workers) == 1
    assert len({sign.name.split("-")[0] for sign in readers.iterdir()} - {str(os.getpid())}) > 1
    assert manifest.tiles == undisturbed
    assert not list(store.check())


def _at(wanted: int, act: Callable[[], None]) -> Callable[[int], None]:
    """A step that acts when so many are done."""
    done = 0

    def step(n: int) -> None:
        nonlocal done
        if done < wanted <= done + n:
            act()
        done += n

    return step
