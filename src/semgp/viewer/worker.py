"""A thread that works on the latest request."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from semgp.errors import SemgpError

T = TypeVar("T")


class SupersededError(Exception):
    """Work that is given up: a newer request has come in."""


class Latest(Generic[T]):
    """A thread that works on one request at a time, always the latest; those in between are dropped.

    Parameters
    ----------
    work : callable
        Takes a request. It may raise `SupersededError` when what waits makes it pointless, or once `closed`.
    failed : callable
        Takes the error where the work raised one of semgp's.
    """

    def __init__(self, work: Callable[[T], None], failed: Callable[[SemgpError], None]) -> None:
        self._work, self._failed = work, failed
        self._next: list[T] = []
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="semgp-viewer", daemon=True)

    def start(self) -> None:
        """Begin to work on what is asked for, or has been."""
        self._thread.start()

    def request(self, item: T) -> None:
        """Ask for work on `item` instead of what waits."""
        with self._changed:
            self._next = [item]
            self._changed.notify()

    @property
    def waiting(self) -> bool:
        """Whether a newer request waits."""
        return bool(self._next)

    @property
    def closed(self) -> bool:
        """Whether the thread is to end."""
        return self._closed

    def close(self) -> None:
        """End the thread, once it is done with what it does."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._next or self._closed)
                if self._closed:
                    return
                item = self._next.pop()
            try:
                self._work(item)
            except SupersededError:
                continue
            except SemgpError as error:
                self._failed(error)
