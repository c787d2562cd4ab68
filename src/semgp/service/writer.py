"""The writer: a second view of the same store, and a thread that adds clouds to it, version by version."""

from __future__ import annotations

from concurrent.futures import Future
from threading import Condition, Thread

from semgp.cloud import LabelledCloud
from semgp.errors import ConflictError, FileFormatError, InputError, SemgpError
from semgp.service.keeping import Keeper, note
from semgp.service.limits import BusyError
from semgp.service.metrics import Metrics
from semgp.service.reader import Reader
from semgp.store import MapStore, StoredMap

TRIES = 5
"""How often clouds are added anew where another writer of the store was faster."""

Pending = tuple[LabelledCloud, "Future[int]"]


class Writer:
    """A thread that takes in clouds: all that wait become one version, which the reader then takes up.

    Parameters
    ----------
    store : MapStore
        Where the map is.
    reader : Reader
        Who answers from it.
    keeper : Keeper
        Who drops old versions, between two that are made.
    metrics : Metrics
        Where the clouds are counted.
    most_sites : int
        See `StoredMap`.
    most_waiting : int
        Clouds that may wait.
    """

    def __init__(
        self,
        store: MapStore,
        reader: Reader,
        keeper: Keeper,
        metrics: Metrics,
        most_sites: int,
        most_waiting: int,
    ) -> None:
        self._store, self._reader, self._keeper, self._metrics = store, reader, keeper, metrics
        self._most_sites, self._most_waiting = most_sites, most_waiting
        self._map: StoredMap | None = None
        self._waiting: list[Pending] = []
        self._closing = False
        self._change = Condition()
        self._thread = Thread(target=self._run, name="semgp-writer", daemon=True)
        self._thread.start()

    def update(self, cloud: LabelledCloud) -> Future[int]:
        """Return the version that has the cloud, once queries are answered from it.

        The future raises InputError for a cloud that the map refuses, ConflictError where other writers were
        faster.

        Raises
        ------
        BusyError
            Too many clouds wait, or the service is closing.
        """
        future: Future[int] = Future()
        with self._change:
            if self._closing:
                raise BusyError("the service is shutting down.")
            if len(self._waiting) >= self._most_waiting:
                raise BusyError(f"{len(self._waiting)} updates wait already: try again later.")
            self._waiting.append((cloud, future))
            self._change.notify()
        return future

    @property
    def waiting(self) -> int:
        """How many clouds wait."""
        return len(self._waiting)

    @property
    def is_alive(self) -> bool:
        """Whether clouds are taken in."""
        return self._thread.is_alive() and not self._closing

    def close(self, *, drop: bool = False) -> int:
        """Take in what waits, or drop it; end, and return how many clouds were dropped."""
        with self._change:
            self._closing = True
            dropped, self._waiting = (self._waiting, []) if drop else ([], self._waiting)
            self._change.notify()
        for _, future in dropped:
            future.set_exception(BusyError("the service has been stopped: the update is dropped."))
        self._metrics.count("semgp_updates_total", len(dropped), result="dropped")
        self._thread.join()
        return len(dropped)

    def _run(self) -> None:
        while batch := self._next():
            self._take_in(batch)
            self._keeper.drop()

    def _next(self) -> list[Pending]:
        with self._change:
            self._change.wait_for(lambda: self._waiting or self._closing)
            batch, self._waiting = self._waiting, []
            return batch

    def _take_in(self, batch: list[Pending]) -> None:
        """Publish a batch, and tell who waits for it; a batch that fails leaves the store as it was."""
        for tries_left in reversed(range(TRIES)):
            try:
                taken = self._add(batch)
                version = self._publish(len(taken))
                for future in taken:
                    future.set_result(version)
                self._metrics.count("semgp_updates_total", len(taken), result="committed")
                return
            except Exception as error:  # whatever it is, the next batch must have its turn
                self._forget()
                batch = [(cloud, future) for cloud, future in batch if not future.done()]
                if isinstance(error, ConflictError) and tries_left:
                    continue
                for _, future in batch:
                    future.set_exception(error)
                self._metrics.count("semgp_updates_total", len(batch), result="failed")
                return

    def _add(self, batch: list[Pending]) -> list[Future[int]]:
        """Add clouds to the newest version in memory; return who waits for those that the map has not refused."""
        if self._map is None:
            self._map = StoredMap(self._store, most_sites=self._most_sites)
        else:
            self._map.refresh()
        taken = []
        for cloud, future in batch:
            try:
                self._map.update(cloud)
                taken.append(future)
            except FileFormatError:
                raise
            except InputError as error:
                future.set_exception(error)
                self._metrics.count("semgp_updates_total", result="refused")
        return taken

    def _publish(self, clouds: int) -> int:
        assert self._map is not None
        version = self._map.commit(note(clouds))
        try:
            self._reader.refresh().result()
        except SemgpError as error:
            raise SemgpError(f"version {version} is there, but is not served yet: {error}") from error
        return version

    def _forget(self) -> None:
        """Let go of what is not committed; the next batch opens the store anew."""
        if self._map is not None:
            self._map.close()
        self._map = None
