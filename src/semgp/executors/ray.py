"""Ray: workers on one machine or many (extra `ray`)."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from typing import Any, Self, TypeVar

from semgp.errors import InputError, MissingExtraError, SemgpError
from semgp.executors.protocol import Steps, no_steps
from semgp.parallel import THREADS_VARIABLE, n_workers

T = TypeVar("T")
R = TypeVar("R")
S = TypeVar("S")

_RETRIES = 10


class RayExecutor:
    """Tasks of a Ray cluster, one core each, tried again on another worker where one has died.

    On a cluster of several machines semgp must be installed on each, and what the work reads and writes must have
    the same path or URL everywhere.

    Parameters
    ----------
    workers : int, optional
        Cores of a cluster that is started here; all of this machine's by default.
    address : str, optional
        Address of a cluster that is there, "auto" for the one this machine belongs to.

    Raises
    ------
    InputError
        No cluster at the address; MissingExtraError without Ray.
    """

    def __init__(self, workers: int | None = None, address: str | None = None) -> None:
        # under `uv run` Ray would make an environment of its own for the workers: they are to have this one
        os.environ.setdefault("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
        try:
            import ray
        except ImportError as error:
            raise MissingExtraError("the executor ray", "ray") from error
        if workers is not None and (workers < 1 or address is not None):
            raise InputError("workers must be at least 1, and are not for a cluster that is there already.")
        self._ray: Any = ray  # its decorators hide types
        self._mine = not ray.is_initialized()
        environment = {"env_vars": {THREADS_VARIABLE: "1"}}  # a task has one core
        if self._mine:
            here = {"num_cpus": workers or n_workers()} if address is None else {"address": address}
            try:
                ray.init(include_dashboard=False, log_to_driver=False, logging_level=logging.ERROR, **here)
            except (ConnectionError, RuntimeError, ValueError) as error:
                raise InputError(f"there is no Ray cluster at {address}: {error}.") from error
        self._options = {"num_cpus": 1, "max_retries": _RETRIES, "runtime_env": environment}

    @property
    def n_workers(self) -> int:
        """How many pieces are done at a time."""
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def map(self, work: Callable[[T], R], items: Sequence[T], steps: Steps = no_steps) -> list[R]:
        """Return the results for all items, in their order."""
        task = self._ray.remote(_call).options(**self._options)
        shared = self._ray.put(work)
        references = [task.remote(shared, item) for item in items]
        self._wait(references, steps)
        return list(self._ray.get(references))

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
        shared, shared_last = self._ray.put(work), self._ray.put(combine)
        results = [task.remote(shared, item) for item in items]
        self._wait([result[0] for result in results], steps)
        combined = [last.remote(shared_last, *(result[k] for result in results)) for k in range(1, n_parts + 1)]
        self._wait(combined, no_steps)
        return list(self._ray.get(combined))

    def _wait(self, references: list[Any], steps: Steps) -> None:
        """Wait for results; the first error is raised at once."""
        left = references
        while left:
            done, left = self._ray.wait(left)
            try:
                self._ray.get(done)
            except self._ray.exceptions.RayTaskError as error:
                for reference in left:
                    self._ray.cancel(reference)
                cause = (
                    error.cause
                )  # what the work raised, without the worker's trace where it is meant for people
                raise cause from (None if isinstance(cause, SemgpError) else error)
            steps(len(done))

    def close(self) -> None:
        """Stop the cluster where it was started here."""
        if self._mine:
            self._ray.shutdown()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _call(work: Callable[[T], R], item: T) -> R:
    return work(item)


def _call_parts(work: Callable[[T], Sequence[R]], item: T) -> tuple[R | None, ...]:
    """The parts, and before them something small to wait for."""
    return (None, *work(item))


def _combine(combine: Callable[[list[R]], S], *parts: R) -> S:
    return combine(list(parts))
