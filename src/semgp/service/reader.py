"""The reader: one map, and one thread that asks it, so that every answer is of one version."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import TypeVar

from numpy.typing import ArrayLike

from semgp.classes import Classes
from semgp.errors import ConflictError
from semgp.maps.protocol import SemanticMap
from semgp.prediction import Prediction
from semgp.service.metrics import Metrics
from semgp.store import StoredMap

T = TypeVar("T")


class Reader:
    """A map that is asked by one thread, one call after the other; a call by itself uses all cores.

    Parameters
    ----------
    semantic_map : SemanticMap
        Nobody else may use it from now on.
    metrics : Metrics
        Where the points are counted.
    """

    def __init__(self, semantic_map: SemanticMap, metrics: Metrics) -> None:
        self._map, self._metrics = semantic_map, metrics
        self._thread = ThreadPoolExecutor(1, "semgp-reader")
        self._refreshes: SimpleQueue[Future[int]] = SimpleQueue()
        self.version = self._present()

    @property
    def classes(self) -> Classes:
        """The map's classes."""
        return self._map.classes

    def query(self, points: ArrayLike) -> Future[tuple[int, Prediction]]:
        """Return the version and its prediction at points (M, 3), once it is their turn."""

        def answer(semantic_map: SemanticMap) -> tuple[int, Prediction]:
            prediction = semantic_map.query(points)
            self._metrics.count("semgp_points_total", len(prediction))
            return self.version, prediction

        return self.ask(answer)

    def ask(self, question: Callable[[SemanticMap], T]) -> Future[T]:
        """Return what a question about the map itself gives, once it is its turn."""

        def turn() -> T:
            self._catch_up()
            try:
                return question(self._map)
            except ConflictError:  # another process has removed the version before we have gone on
                self._go_on()
                return question(self._map)

        return self._thread.submit(turn)

    def refresh(self) -> Future[int]:
        """Go on with the newest version right after the present call, whoever waits, and return its number."""
        future: Future[int] = Future()
        self._refreshes.put(future)
        self._thread.submit(self._catch_up)
        return future

    def close(self) -> None:
        """End once the present call is answered; those that wait are cancelled."""
        self._thread.shutdown(cancel_futures=True)

    def _catch_up(self) -> None:
        """Do the refreshes that were asked for; who asked is told how it went."""
        while not self._refreshes.empty():
            future, start = self._refreshes.get(), time.perf_counter()
            try:
                self._go_on()
                future.set_result(self.version)
            except Exception as error:
                future.set_exception(error)
            self._metrics.time("semgp_refresh_seconds", time.perf_counter() - start)

    def _go_on(self) -> None:
        """Go on with the newest version."""
        if isinstance(self._map, StoredMap):
            self._map.refresh()
        self.version = self._present()

    def _present(self) -> int:
        """The version, 1 for maps that have none."""
        return self._map.version if isinstance(self._map, StoredMap) else 1
