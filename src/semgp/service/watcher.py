"""The watcher: a thread that looks for what other processes have published."""

from __future__ import annotations

import math
from threading import Event, Thread

from semgp.errors import InputError
from semgp.service.keeping import Keeper
from semgp.service.metrics import Metrics
from semgp.service.reader import Reader
from semgp.store import MapStore


class Watcher:
    """A thread that lists the versions of a store every few seconds; newer ones the reader takes up.

    It also has old versions dropped for which other writers were in the way.

    Parameters
    ----------
    store : MapStore
        Where the map is.
    reader : Reader
        Who answers from it.
    keeper : Keeper
        Who drops its old versions.
    metrics : Metrics
        Where looks are counted.
    seconds : float
        From one look to the next.

    Raises
    ------
    InputError
        Seconds that are not positive.
    """

    def __init__(self, store: MapStore, reader: Reader, keeper: Keeper, metrics: Metrics, seconds: float) -> None:
        if not (math.isfinite(seconds) and seconds > 0):
            raise InputError(f"newer versions can be looked for every few seconds, or never (0), not {seconds}.")
        self._store, self._reader, self._keeper, self._metrics = store, reader, keeper, metrics
        self._seconds, self._closing = seconds, Event()
        self._thread = Thread(target=self._run, name="semgp-watcher", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End after the present look."""
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closing.wait(self._seconds):
            try:
                self._look()
            except Exception:  # such as a store that is away for a while: the next look may be better
                self._metrics.count("semgp_looks_total", result="failed")
            self._keeper.drop()

    def _look(self) -> None:
        if max(self._store.numbers(), default=0) > self._reader.version:
            self._reader.refresh().result()
            self._metrics.count("semgp_looks_total", result="newer")
