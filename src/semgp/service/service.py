"""The service without its protocol: who reads the map, who writes it, and what is known about both."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from semgp.maps.files import load_map
from semgp.maps.protocol import SemanticMap
from semgp.service.limits import Limits, Slots
from semgp.service.metrics import Metrics, resident_bytes
from semgp.service.reader import Reader
from semgp.service.writer import Writer
from semgp.store import MOST_SITES, StoredMap


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

    Raises
    ------
    InputError
        No map there, or a damaged one.
    """

    def __init__(
        self,
        location: str | Path,
        limits: Limits | None = None,
        *,
        most_sites: int = MOST_SITES,
        read_only: bool = False,
    ) -> None:
        self.name = Path(location).name
        self.limits, self.metrics = limits or Limits(), Metrics()
        semantic_map = load_map(location)
        self.writer: Writer | None = None
        self.open_version: Callable[[int], SemanticMap] = lambda _: load_map(location)
        self.why_read_only = "the service was started read-only: restart it without --read-only."
        store = semantic_map.store if isinstance(semantic_map, StoredMap) else None
        if store is not None:
            semantic_map = StoredMap(store, most_sites=most_sites)
            self.open_version = lambda version: StoredMap(store, version, most_sites=most_sites)
        else:
            self.why_read_only = (
                f"{self.name} is a single file, which has no versions and is served read-only: build "
                "the map as a store, into a folder or bucket, and serve that."
            )
        self.reader = Reader(semantic_map, self.metrics)
        if store is not None and not read_only:
            self.writer = Writer(store, self.reader, self.metrics, most_sites, self.limits.most_updates)
        self.queries = Slots(self.limits.most_queries, "queries")
        self.updates = Slots(self.limits.most_updates, "updates")

    @property
    def is_ready(self) -> bool:
        """Whether queries and, where they are taken at all, updates are answered."""
        return self.writer is None or self.writer.is_alive

    def facts(self) -> dict[str, Any]:
        """Return what there is to know about the service beside its map."""
        return {"version": self.reader.version, "read_only": self.writer is None, "limits": vars(self.limits)}

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
        self.reader.close()
        return dropped
