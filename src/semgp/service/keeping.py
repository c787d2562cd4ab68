"""Keeping: which versions a service lets go of, so that its updates do not fill the disk."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

from semgp.errors import FileFormatError, InputError
from semgp.service.metrics import Metrics
from semgp.service.reader import Reader
from semgp.store import MapStore

KEEP = 20
"""Versions that stay, where other writers can be seen."""

_OWN = re.compile(r"[0-9]+ clouds? by the service")


def note(clouds: int) -> str:
    """Return what a service says of a version that it makes; see `Keeper`."""
    return f"{clouds} cloud{'s' * (clouds != 1)} by the service"


def versions_to_keep(store: MapStore, keep: int | None, only_writer: bool) -> int:
    """Return how many versions stay, 0 for all: what is asked for, or by default what is safe.

    Raises
    ------
    InputError
        A negative number; or one at all where other writers cannot be seen, who might need what is removed.
    """
    if keep is not None and keep < 0:
        raise InputError(f"keep is a number of versions, or 0 for all of them, not {keep}.")
    if keep == 0 or only_writer or store.sees_writers:
        return KEEP if keep is None else keep
    if keep is None:
        return 0
    raise InputError(
        f"{store.location}: writers cannot see each other here, and might need what is removed. Keep all (0), or "
        "say that nobody else writes to this map while it is served (--only-writer)."
    )


class Keeper:
    """Lets go of versions that services have made, but for the newest and those that somebody here reads.

    Versions that others have made stay: somebody may want to go back to them. `semgp store prune` removes them.

    Parameters
    ----------
    store : MapStore
        Where the map is.
    reader : Reader
        Who answers from it.
    metrics : Metrics
        Where versions are counted.
    keep : int
        How many of the newest versions stay, whoever has made them; 0 for all.
    """

    def __init__(self, store: MapStore, reader: Reader, metrics: Metrics, keep: int) -> None:
        self._store, self._reader, self._metrics, self._keep = store, reader, metrics, keep
        self._lock = Lock()
        self._read: Counter[int] = Counter()
        self._own: dict[int, bool] = {}

    @contextmanager
    def reading(self) -> Iterator[int]:
        """Yield the version that queries are answered from; it stays for the length of the block."""
        with self._lock:
            version = self._reader.version
            self._read[version] += 1
        try:
            yield version
        finally:
            with self._lock:
                self._read[version] -= 1

    def drop(self) -> None:
        """Remove what need not stay; while other writers are at work nothing, the next call tries again.

        Never raises: what fails is counted, and the map is served on.
        """
        if not self._keep:
            return
        try:
            with self._lock:
                old = self._old()
                dropped = self._store.drop(old) if old else 0
        except Exception:  # whatever it is, updates must go on
            self._metrics.count("semgp_drops_total", result="failed")
            return
        if dropped is None:
            self._metrics.count("semgp_drops_total", result="put off")
        elif old:
            self._metrics.count("semgp_drops_total", result="done")
            self._metrics.count("semgp_versions_dropped_total", len(old))

    def _old(self) -> list[int]:
        """The versions that need not stay; those from the reader's on do."""
        older = self._store.numbers()[: -self._keep]
        self._own = {number: self._is_own(number) for number in older}
        return [n for n in older if self._own[n] and n < self._reader.version and not self._read[n]]

    def _is_own(self, number: int) -> bool:
        """Whether a service has made a version; one that cannot be read counts as somebody else's."""
        if number in self._own:
            return self._own[number]
        try:
            return _OWN.fullmatch(self._store.manifest(number).note) is not None
        except FileFormatError:
            return False
