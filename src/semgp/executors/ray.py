"""Ray: workers on one machine or many (extra `ray`)."""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pickle import PicklingError
from typing import Any, Self, TypeVar

from semgp.errors import ExecutorError, InputError, MissingExtraError, SemgpError
from semgp.executors.protocol import Steps, no_steps
from semgp.parallel import THREADS_VARIABLE, n_workers

T = TypeVar("T")
R = TypeVar("R")
S = TypeVar("S")

_RETRIES = 10
_PATIENCE = 10.0  # seconds for a cluster to answer: Ray itself would try for ten minutes

EVERYWHERE = {
    "RAY_ENABLE_UV_RUN_RUNTIME_ENV": "0",  # under `uv run` workers would get an environment of their own
    "RAY_USAGE_STATS_ENABLED": "0",  # no request leaves the machine
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # no warning of changes to come
}
ALONE = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}  # not a cluster: its ports are on loopback only


class RayExecutor:
    """Tasks of a Ray cluster, one core each, tried again on another worker where one has died.

    On a cluster of several machines semgp must be installed on each, and what the work reads and writes must have
    the same path or URL everywhere. A cluster that is started here listens on loopback only, has no dashboard, and
    reports nothing to anybody.

    Parameters
    ----------
    workers : int, optional
        Cores of a cluster that is started here; all of this machine's by default.
    address : str, optional
        Address of a cluster that is there, such as 10.0.0.1:6379, or "auto" for the one this machine belongs to.

    Raises
    ------
    InputError
        Fewer than one worker, or no cluster at the address; MissingExtraError without Ray.
    """

    def __init__(self, workers: int | None = None, address: str | None = None) -> None:
        if workers is not None and (workers < 1 or address is not None):
            raise InputError("workers must be at least 1, and are not for a cluster that is there already.")
        for name, value in (EVERYWHERE | (ALONE if address is None else {})).items():
            os.environ.setdefault(name, value)  # Ray reads them when it is imported or started
        try:
            import ray
        except ImportError as error:
            raise MissingExtraError("the executor ray", "ray") from error
        self._ray: Any = ray  # its decorators hide types
        self._mine = not ray.is_initialized()
        if self._mine:
            self._start(workers or n_workers(), address)
        environment = {"env_vars": {THREADS_VARIABLE: "1"}}  # a task has one core
        self._options = {"num_cpus": 1, "max_retries": _RETRIES, "runtime_env": environment}

    def _start(self, workers: int, address: str | None) -> None:
        """Start a cluster, or join one."""
        alone = {"address": "local", "num_cpus": workers, "include_dashboard": False}
        try:
            if address is not None:
                _require_answer(address)
            self._ray.init(
                log_to_driver=False,
                logging_level=logging.ERROR,
                **(alone if address is None else {"address": address}),
            )
        except (OSError, RuntimeError, ValueError) as error:
            where = "Ray cannot be started" if address is None else f"there is no Ray cluster at {address}"
            raise InputError(f"{where}: {_first_line(error)}") from error

    @property
    def n_workers(self) -> int:
        """How many pieces are done at a time."""
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def map(self, work: Callable[[T], R], items: Sequence[T], steps: Steps = no_steps) -> list[R]:
        """Return the results for all items, in their order.

        Raises
        ------
        InputError
            Work or items that cannot be sent to other processes; ExecutorError where workers die again and again.
        """
        task = self._ray.remote(_call).options(**self._options)
        with _sending():
            shared = self._ray.put(work)
            references = [task.remote(os.getcwd(), shared, item) for item in items]
        return self._gather(references, steps)

    def shuffle(
        self,
        work: Callable[[T], Sequence[R]],
        items: Sequence[T],
        combine: Callable[[list[R]], S],
        n_parts: int,
        steps: Steps = no_steps,
    ) -> list[S]:
        """Bring the parts of all results together, and combine them; parts stay with the workers until then."""
        task = self._ray.remote(_call_parts).options(**self._options, num_returns=n_parts + 1)
        last = self._ray.remote(_combine).options(**self._options)
        with _sending():
            shared, shared_last = self._ray.put(work), self._ray.put(combine)
            results = [task.remote(os.getcwd(), shared, item) for item in items]
        self._gather([result[0] for result in results], steps)
        combined = [
            last.remote(os.getcwd(), shared_last, *(result[k] for result in results))
            for k in range(1, n_parts + 1)
        ]
        return self._gather(combined, no_steps)

    def _gather(self, references: list[Any], steps: Steps) -> list[Any]:
        """Return results in their order.

        After an error the other tasks are left to end by themselves, or with the cluster: where one ends while it
        is being cancelled, Ray (2.60) aborts this process.
        """
        results: list[Any] = []
        try:
            for reference in references:
                results.append(self._ray.get(reference))
                steps(1)
        except self._ray.exceptions.RayTaskError as error:
            cause = error.cause  # what the work raised; where that is meant for people, without the worker's trace
            raise cause from (None if isinstance(cause, SemgpError) else error)
        except self._ray.exceptions.RayError as error:
            raise ExecutorError(f"the workers have failed {_RETRIES} times: {_first_line(error)}") from error
        return results

    def close(self) -> None:
        """Stop the cluster where it was started here, or leave it."""
        if self._mine:
            self._ray.shutdown()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _require_answer(address: str) -> None:
    """Raise OSError where nobody listens at an address."""
    host, _, port = address.rpartition(":")
    if port.isdecimal():
        socket.create_connection((host, int(port)), _PATIENCE).close()


@contextmanager
def _sending() -> Iterator[None]:
    try:
        yield
    except (TypeError, PicklingError) as error:
        reason = _first_line(error.__cause__ or error)
        raise InputError(f"the work cannot be sent to other processes: {reason}") from error


def _first_line(error: BaseException) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)


def _call(folder: str, work: Callable[[T], R], item: T) -> R:
    """Do a piece of work, in the folder of the process that asks for it where there is one of that name."""
    if os.path.isdir(folder):
        os.chdir(folder)
    return work(item)


def _call_parts(folder: str, work: Callable[[T], Sequence[R]], item: T) -> tuple[R | None, ...]:
    """The parts, and before them something small to wait for."""
    return (None, *_call(folder, work, item))


def _combine(folder: str, combine: Callable[[list[R]], S], *parts: R) -> S:
    return _call(folder, combine, list(parts))
