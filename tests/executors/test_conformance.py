"""What every executor does alike."""

import pickle
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from typing import Any

import pytest

from semgp.errors import ExecutorError, FileFormatError, InputError, MissingExtraError
from semgp.executors import Executor, Threads, open_executor
from tests.executors import pieces


class TestEvery:
    def test_results_are_in_the_order_of_the_items(self, executor: Executor) -> None:
        items = list(range(20))[::-1]
        assert executor.map(pieces.square, items) == [x * x for x in items]
        assert executor.map(pieces.square, []) == []
        assert executor.n_workers in (1, 2)

    def test_steps_are_called_for_each_item(self, executor: Executor) -> None:
        seen: list[int] = []
        executor.map(pieces.square, range(5), seen.append)
        executor.shuffle(pieces.divide, [4, 5], pieces.join, 3, seen.append)
        assert sum(seen) == 7

    def test_a_shuffle_brings_parts_together_in_the_order_of_the_items(self, executor: Executor) -> None:
        assert executor.shuffle(pieces.divide, [7, 2, 4], pieces.join, 3) == [
            [0, 3, 6, 0, 0, 3],
            [1, 4, 1, 1],
            [2, 5, 2],
        ]
        assert executor.shuffle(pieces.divide, [], pieces.join, 3) == [[], [], []]

    def test_work_may_hold_what_it_needs(self, executor: Executor) -> None:
        base = 10
        assert executor.map(lambda x: x + base, [1, 2]) == [11, 12]

    @pytest.mark.parametrize(
        ("work", "kind", "message"),
        [
            (pieces.refuse, InputError, "two is refused."),
            (pieces.damaged, FileFormatError, "s3://bucket/tile.npz: is damaged."),
            (pieces.lacking, MissingExtraError, "this needs an optional dependency: pip install 'semgp[that]'"),
            (pieces.broken, ZeroDivisionError, "a bug"),
        ],
    )
    def test_errors_of_the_work_come_out_as_themselves(
        self, executor: Executor, work: pieces.Work, kind: type[Exception], message: str
    ) -> None:
        with pytest.raises(kind) as caught:
            executor.map(work, range(4))
        assert type(caught.value) is kind
        assert str(caught.value) == message
        assert executor.map(pieces.square, [3]) == [9]  # and it goes on working

    def test_errors_in_either_step_of_a_shuffle_come_out(self, executor: Executor) -> None:
        with pytest.raises(InputError, match="two is refused"):
            executor.shuffle(lambda x: pieces.divide(pieces.refuse(x)), [1, 2], pieces.join, 3)
        with pytest.raises(InputError, match="two is refused"):
            executor.shuffle(pieces.divide, [4], pieces.refuse_all, 3)

    def test_work_is_done_in_the_folder_of_the_caller(
        self, executor: Executor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        assert executor.map(pieces.here, [0]) == [str(tmp_path)]


class TestRay:
    def test_work_that_cannot_be_sent_is_refused(self, ray_cluster: Executor) -> None:
        lock = Lock()
        with pytest.raises(InputError, match=r"cannot be sent to other processes: cannot pickle '_thread\.lock'"):
            ray_cluster.map(lambda x: (lock, x), [1])
        with pytest.raises(InputError, match="cannot be sent to other processes"):
            ray_cluster.map(str, [lock])

    def test_workers_that_always_die_are_given_up(
        self, ray_cluster: Executor, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(ray_cluster._options, "max_retries", 1)  # type: ignore[attr-defined]
        with pytest.raises(ExecutorError, match="the workers have failed"):
            ray_cluster.map(pieces.die, [0])

    def test_nothing_leaves_the_machine(self, ray_cluster: Executor) -> None:
        import ray
        from ray._common.usage.usage_lib import usage_stats_enabled

        assert not usage_stats_enabled()
        nodes: Callable[[], list[dict[str, Any]]] = ray.nodes
        assert {node["NodeManagerAddress"] for node in nodes()} == {"127.0.0.1"}

    def test_a_second_one_shares_the_cluster_and_leaves_it(self, ray_cluster: Executor) -> None:
        with open_executor("ray") as second:
            assert second.map(pieces.square, [2]) == [4]
        assert ray_cluster.map(pieces.square, [2]) == [4]


class TestOpening:
    def test_by_name(self) -> None:
        assert isinstance(open_executor("threads", 3), Threads)
        assert open_executor("threads", 3).n_workers == 3
        with pytest.raises(InputError, match="threads or ray, not 'slurm'"):
            open_executor("slurm")
        with pytest.raises(InputError, match="threads have no address"):
            open_executor("threads", address="auto")

    @pytest.mark.parametrize("name", ["threads", "ray"])
    @pytest.mark.parametrize("workers", [0, -1])
    def test_fewer_than_one_worker(self, name: str, workers: int) -> None:
        with pytest.raises(InputError, match="at least"):
            open_executor(name, workers)

    def test_workers_of_a_cluster_that_is_there(self) -> None:
        with pytest.raises(InputError, match="not for a cluster that is there already"):
            open_executor("ray", workers=2, address="auto")

    def test_ray_missing(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "ray", None)
        with pytest.raises(MissingExtraError, match=r"semgp\[ray\]"):
            open_executor("ray")

    def test_an_address_without_a_cluster_is_told_at_once(
        self, ray_cluster: Executor, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        import ray

        monkeypatch.setattr(ray, "is_initialized", lambda: False)
        with socket.socket() as closed:
            closed.bind(("127.0.0.1", 0))
            port = closed.getsockname()[1]
        with pytest.raises(InputError, match=f"no Ray cluster at 127.0.0.1:{port}"):
            open_executor("ray", address=f"127.0.0.1:{port}")


@pytest.mark.parametrize("error", [FileFormatError("s3://b/t", "is damaged."), MissingExtraError("this", "that")])
def test_errors_can_be_sent(error: Exception) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
