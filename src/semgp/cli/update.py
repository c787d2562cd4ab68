"""`semgp update`: more scans into a map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from semgp.cli.console import counted, keeping, progress, report
from semgp.cli.inputs import PLAIN, AnyInputs, sources, tell_labels
from semgp.cli.places import require_place
from semgp.errors import InputError

if TYPE_CHECKING:
    from rich.progress import Progress

    from semgp.maps.protocol import SerialisableMap
    from semgp.readers import Scans
    from semgp.store import MapStore

Workers = Annotated[Literal["threads", "ray"], Parameter(group="Many machines")]
Address = Annotated[str | None, Parameter(group="Many machines")]
Count = Annotated[int | None, Parameter(group="Many machines")]

WHERE_LABELS = (
    "Say where labels are with --field (point files) or --labels (data sets, label folders), what they mean with "
    "--classes, or have a --network label images."
)
"""What to do about scans without labels."""

BUILDING = "build"
"""The note of versions that a build makes, on the way and at its end."""


def update(
    map_place: Path,
    /,
    scans: list[Path],
    *,
    inputs: AnyInputs = PLAIN,
    executor: Workers = "threads",
    workers: Count = None,
    address: Address = None,
) -> None:
    """Add labelled scans to a map.

    Example: semgp update drive sequences/09

    Parameters
    ----------
    map_place
        A map that "semgp build" wrote: a store, which gets new versions, or a file, which is replaced.
    scans
        As for "semgp build", of the map's classes and in its frame.
    executor
        Who does the work of a store: the threads of this process, or a Ray cluster.
    workers
        How many at a time; one for each core by default.
    address
        Address of a Ray cluster, "auto" for the one this machine belongs to; left out, one is started here.
    """
    require_place(map_place, *scans)

    from semgp.cli.describe import elements
    from semgp.maps.files import load_map, save_map
    from semgp.maps.protocol import SerialisableMap
    from semgp.store import StoredMap

    clouds = sources(scans, inputs)
    semantic_map = load_map(map_place)
    if isinstance(semantic_map, StoredMap):
        update_store(map_place, clouds, executor, workers, address)
        return
    if not isinstance(semantic_map, SerialisableMap):
        raise InputError(f"{map_place}: maps of the kind {semantic_map.kind} cannot be written.")
    if executor != "threads":
        raise InputError("--executor is for stores, and this map is one file.")
    with progress() as bars:
        fill(semantic_map, clouds, bars)
    tell_labels(clouds)
    save_map(semantic_map, map_place)
    words = f"{map_place}: {elements(semantic_map)} with {counted(len(clouds), 'scan')} more"
    report(words, out=map_place, elements=len(semantic_map))


def fill(semantic_map: SerialisableMap, clouds: Scans, bars: Progress) -> None:
    """Update a map in memory with all clouds."""
    from semgp.maps.gp import GPSemanticMap

    for cloud in bars.track(clouds, description="building the map"):
        semantic_map.update(cloud)
    if not len(semantic_map):
        raise InputError(f"no scan has a label: nothing to build a map from. {WHERE_LABELS}")
    if isinstance(semantic_map, GPSemanticMap):
        semantic_map.solve()


def update_store(
    place: Path, clouds: Scans, executor: str, workers: int | None, address: str | None, *, done: int | None = None
) -> None:
    """Add clouds to a store, a version every few of them, and say what came of it.

    For a build, `done` is how many of them it holds already; None for an update.
    """
    from semgp.executors import open_executor
    from semgp.store import MapStore
    from semgp.store import build as build_stored

    store = MapStore(place)
    begun = store.manifest()
    left, note = clouds[done or 0 :], "" if done is None else BUILDING

    def kept() -> str:
        manifest = store.manifest()
        words = f"{store.location} holds version {manifest.number} with {manifest.clouds} scans"
        if done is not None:
            return f"{words}; --resume goes on from there"
        new = manifest.clouds - begun.clouds
        return f"{words}, {new} of them new" + (f"; --first {left.indices[new]} goes on from there" if new else "")

    with keeping(kept), progress() as bars:
        bar = bars.add_task("building the map", total=len(clouds), completed=done or 0)
        if begun.settings.forgetting is None:
            with open_executor(executor, workers, address) as work:
                build_stored(store, left, work, note=note, steps=lambda n: bars.update(bar, advance=n))
        else:
            _update_in_order(store, left, note, bars)
    tell_labels(clouds)
    manifest = store.manifest()
    if not manifest.sites:
        raise InputError(f"no scan has a label: {store.location} holds an empty map. {WHERE_LABELS}")
    report(
        f"{store.location}: version {manifest.number}, {manifest.sites:,} sites from "
        f"{counted(manifest.clouds, 'scan')} in {counted(len(manifest.tiles), 'tile')}, "
        f"{manifest.n_bytes / 1e6:.1f} MB",
        out=store.location, version=manifest.number, sites=manifest.sites, scans=manifest.clouds,
        bytes=manifest.n_bytes,
    )  # fmt: skip


def _update_in_order(store: MapStore, clouds: Scans, note: str, bars: Progress) -> None:
    """Add clouds one after the other, to a map that forgets."""
    from semgp.store import BATCH, StoredMap

    with StoredMap(store) as stored:
        for i, cloud in enumerate(bars.track(clouds, description="building the map"), 1):
            stored.update(cloud)
            if i % BATCH == 0 or i == len(clouds):
                stored.commit(note)
