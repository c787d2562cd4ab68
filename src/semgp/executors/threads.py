"""Threads of this process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Self, TypeVar

from semgp.errors import InputError
from semgp.executors.protocol import Steps, no_steps
from semgp.parallel import n_workers, parallel_map

T = TypeVar("T")
R = TypeVar("R")
S = TypeVar("S")


class Threads:
    """The executor by default: threads, with one BLAS thread each.

    Parameters
    ----------
    workers : int, optional
        As many as there are cores by default.

    Raises
    ------
    InputError
        Fewer than one.
    """

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise InputError(f"at least one worker is needed, not {workers}.")
        self._workers = workers or n_workers()

    @property
    def n_workers(self) -> int:
        """How many pieces are done at a time."""
        return self._workers

    def map(self, work: Callable[[T], R], items: Sequence[T], steps: Steps = no_steps) -> list[R]:
        """Return the results for all items, in their order."""

        def done(item: T) -> R:
            result = work(item)
            steps(1)
            return result

        return parallel_map(done, items, self._workers)

    def shuffle(
        self,
        work: Callable[[T], Sequence[R]],
        items: Sequence[T],
        combine: Callable[[list[R]], S],
        n_parts: int,
        steps: Steps = no_steps,
    ) -> list[S]:
        """Bring the parts of all results together, and combine them."""
        parts = self.map(work, items, steps)
        return self.map(lambda k: combine([part[k] for part in parts]), range(n_parts))

    def close(self) -> None:
        """Do nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
