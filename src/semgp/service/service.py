"""The service without its protocol: who reads the map, who writes it, and what is known about both."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from semgp.maps.files import load_map
from semgp.maps.protocol import SemanticMap
from semgp.service.keeping import Keeper, versions_to_keep
from semgp.service.limits import Limits, Slots
from semgp.service.metrics import Metrics, resident_bytes
from semgp.service.reader import Reader
from semgp.service.watcher import Watcher
from semgp.service.writer import Writer
from semgp.store import MOST_SITES, MapStore, StoredMap

View = Callable[[], AbstractContextManager[tuple[int, SemanticMap]]]


class Service:
    """A map that many ask and some write to.

    Parameters
    ----------
    location : str or Path
        A map file, or the folder or URL of a stored map.
    limits : Limits, optional
        What callers may ask.
    most_sites : int, optional
        Sites in memory, of a stored map: so many for queries, and as many for updates.
    read_only : bool, optional
        Take no updates; so it is for all but stored maps.
    keep : int, optional
        So many versions of a stored map stay; of the older ones, those that services have made are dropped. 0
        keeps all, as a service that is read-only does. Left out: 20 where other writers can be seen, else all.
    only_writer : bool, optional
        Nobody else writes to the map: then old versions are dropped from buckets, too.
    poll : float, optional
        Seconds from one look for versions of other processes to the next; 0 for never.

    Raises
    ------
    InputError
        No map there, or a damaged one, or numbers that cannot be.
    """

    def __init__(
        self,
        location: str | Path,
        limits: Limits | None = None,
        *,
        most_sites: int = MOST_SITES,
        read_only: bool = False,
        keep: int | None = None,
        only_writer: bool = False,
        poll: float = 5.0,
    ) -> None:
        self.name = Path(location).name
        self.limits, self.metrics = limits or Limits(), Metrics()
        self.queries = Slots(self.limits.most_queries, "queries")
        self.updates = Slots(self.limits.most_updates, "updates")
        self.keep, self.poll = 0, poll
        self.writer: Writer | None = None
        self._watcher: Watcher | None = None
        semantic_map = load_map(location)
        if not isinstance(semantic_map, StoredMap):
            self.why_read_only = (
                f"{self.name} is a single file, which has no versions and is served read-only: build "
                "the map as a store, into a folder or bucket, and serve that."
            )
            self.reader = Reader(semantic_map, self.metrics)
            self._view: View = lambda: nullcontext((1, load_map(location)))
            return
        self.why_read_only = "the service was started read-only: restart it without --read-only."
        store = semantic_map.store
        self.keep = 0 if read_only else versions_to_keep(store, keep, only_writer)
        self.reader = Reader(StoredMap(store, most_sites=most_sites), self.metrics)
        keeper = Keeper(store, self.reader, self.metrics, self.keep)
        self._view = lambda: _stored_view(store, keeper, most_sites)
        if poll:
            self._watcher = Watcher(store, self.reader, keeper, self.metrics, poll)
        if not read_only:
            most = self.limits.most_updates
            self.writer = Writer(store, self.reader, keeper, self.metrics, most_sites, most)

    def view(self) -> AbstractContextManager[tuple[int, SemanticMap]]:
        """Return a second view of the map that is answered from, and its version, which stays for a block."""
        return self._view()

    @property
    def is_ready(self) -> bool:
        """Whether queries and, where they are taken at all, updates are answered."""
        return self.writer is None or self.writer.is_alive

    def facts(self) -> dict[str, Any]:
        """Return what there is to know about the service beside its map."""
        return {
            "version": self.reader.version,
            "read_only": self.writer is None,
            "keep": self.keep,
            "poll": self.poll,
            "limits": vars(self.limits),
        }

    def metrics_text(self) -> str:
        """Return the metrics, see `Metrics`."""
        resident = resident_bytes()
        gauges = {
            "semgp_version": float(self.reader.version),
            "semgp_queries_in_flight": float(self.queries.taken),
            "semgp_updates_waiting": 0.0 if self.writer is None else float(self.writer.waiting),
        }
        return self.metrics.text(
            gauges if resident is None else {**gauges, "process_resident_memory_bytes": resident}
        )

    def close(self, *, drop: bool = False) -> int:
        """End: take in the updates that wait, or drop them, and return how many were dropped."""
        dropped = 0 if self.writer is None else self.writer.close(drop=drop)
        if self._watcher is not None:
            self._watcher.close()
        self.reader.close()
        return dropped


@contextmanager
def _stored_view(store: MapStore, keeper: Keeper, most_sites: int) -> Iterator[tuple[int, SemanticMap]]:
    with keeper.reading() as version:
        yield version, StoredMap(store, version, most_sites=most_sites)
