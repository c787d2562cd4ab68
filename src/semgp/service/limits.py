"""What one caller may ask of a service, so that it lives within its memory."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from semgp.errors import InputError, SemgpError


class BusyError(SemgpError):
    """As many wait as may: try again later."""


@dataclass(frozen=True)
class Limits:
    """Limits of a service.

    Parameters
    ----------
    most_points : int
        Points a query.
    most_bytes : int
        Bytes of a body, and of the arrays that an update's body unpacks to four times as many.
    most_json_bytes : int
        Bytes of a JSON body: Python's objects take many times their text.
    most_queries : int
        Queries at once, the one that is answered and those that wait.
    most_updates : int
        Updates that wait.
    seconds : float
        For a body to arrive, and for an answer after that.

    Raises
    ------
    InputError
        A limit that is not positive.
    """

    most_points: int = 1_000_000
    most_bytes: int = 64 << 20
    most_json_bytes: int = 1 << 20
    most_queries: int = 32
    most_updates: int = 16
    seconds: float = 60.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} must be positive, not {value}.")

    @property
    def most_unpacked(self) -> int:
        """Bytes of the arrays of an update."""
        return 4 * self.most_bytes


class Slots:
    """So many requests at once; for one thread, that of the event loop.

    Parameters
    ----------
    most : int
        How many.
    what : str
        What they are, for the message.
    """

    def __init__(self, most: int, what: str) -> None:
        self.most, self.what, self.taken = most, what, 0

    @contextmanager
    def one(self) -> Iterator[None]:
        """Take a slot for the length of a block; BusyError where there is none."""
        if self.taken >= self.most:
            raise BusyError(f"{self.taken} {self.what} wait already: try again later.")
        self.taken += 1
        try:
            yield
        finally:
            self.taken -= 1
