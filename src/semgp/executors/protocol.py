"""What an executor is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, Protocol, Self, TypeVar

T = TypeVar("T")
R = TypeVar("R")
S = TypeVar("S")

Steps = Callable[[int], Any]
"""Called with 1 whenever a piece of work is done: for progress bars."""


def no_steps(_: int) -> None:
    """Show nothing."""


class Executor(Protocol):
    """Does pieces of work that do not depend on each other.

    The work is a pure function: the same for the same item, and without effects but files that are created once.
    It may be done twice, where a worker has died. What it needs besides its item belongs into the callable itself,
    which reaches each worker once. The results do not depend on the number of workers, nor on their order.
    """

    @property
    def n_workers(self) -> int:
        """How many pieces are done at a time."""
        ...

    def map(self, work: Callable[[T], R], items: Sequence[T], steps: Steps = no_steps) -> list[R]:
        """Return the results for all items, in their order.

        Raises
        ------
        Exception
            What the work raises.
        """
        ...

    def shuffle(
        self,
        work: Callable[[T], Sequence[R]],
        items: Sequence[T],
        combine: Callable[[list[R]], S],
        n_parts: int,
        steps: Steps = no_steps,
    ) -> list[S]:
        """Cut each item's result into parts, bring those of one number together, and return what they combine to.

        Parameters
        ----------
        work : callable
            Returns `n_parts` parts for an item.
        items : sequence
            One piece of work each.
        combine : callable
            Takes the parts of one number, in the order of the items.
        n_parts : int
            Number of parts.
        steps : callable, optional
            Called for each item that is done.
        """
        ...

    def close(self) -> None:
        """End what was started for the work."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
