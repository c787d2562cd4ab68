"""`semgp store`: the versions of a stored map."""

from __future__ import annotations

from pathlib import Path

from cyclopts import App

from semgp.cli.console import counted, progress, report
from semgp.cli.places import require_place
from semgp.errors import FileFormatError

store_app = App(name="store", help="List, check, roll back and prune the versions of a stored map.")


@store_app.command
def versions(place: Path, /) -> None:
    """List the versions of a stored map.

    Example: semgp store versions drive

    Parameters
    ----------
    place
        The store's folder or URL.
    """
    require_place(place)

    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from semgp.store import MapStore

    store = MapStore(place)
    store.manifest()  # says so where there is none
    table = Table("version", "time", "scans", "sites", "tiles", "MB", "note", box=SIMPLE_HEAD)
    facts = []
    for number in store.numbers():
        try:
            m = store.manifest(number)
        except FileFormatError as error:
            table.add_row(str(number), "", "", "", "", "", str(error))
            facts.append({"version": number, "error": str(error)})
            continue
        row = (m.time[:19], f"{m.clouds:,}", f"{m.sites:,}", f"{len(m.tiles):,}", f"{m.n_bytes / 1e6:.1f}", m.note)
        table.add_row(str(number), *row)
        facts.append({"version": number, "time": m.time, "scans": m.clouds, "sites": m.sites, "note": m.note})
    report(table, versions=facts)


@store_app.command
def rollback(place: Path, /, *, to: int, note: str = "") -> None:
    """Publish an older version again, as the newest; the ones in between stay.

    Example: semgp store rollback drive --to 3

    Parameters
    ----------
    place
        The store's folder or URL.
    to
        Number of the older version.
    note
        What to say of the new one.
    """
    require_place(place)

    from semgp.store import MapStore

    store = MapStore(place)
    manifest = store.roll_back(to, note)
    report(
        f"{store.location}: version {manifest.number} is version {to} again", version=manifest.number, same_as=to
    )


@store_app.command
def prune(place: Path, /, *, keep: int) -> None:
    """Remove all but the newest versions, and the files that only those used.

    Example: semgp store prune drive --keep 5

    Parameters
    ----------
    place
        The store's folder or URL. While others read older versions, or write to a bucket, do not prune.
    keep
        How many versions stay.
    """
    require_place(place)

    from semgp.store import MapStore

    store = MapStore(place)
    store.manifest()
    gone = store.prune(keep)
    report(
        f"{store.location}: {counted(len(store.numbers()), 'version')}, {counted(gone, 'file')} removed",
        files_removed=gone,
    )


@store_app.command
def check(place: Path, /, *, version: int | None = None) -> None:
    """Read every file of a version, and compare checksums.

    Example: semgp store check drive

    Parameters
    ----------
    place
        The store's folder or URL.
    version
        Number of the version; the newest by default.
    """
    require_place(place)

    from semgp.store import MapStore

    store = MapStore(place)
    manifest = store.manifest(version)
    with progress() as bars:
        bars.add_task(f"reading {len(manifest.tiles):,} tiles", total=None)
        damaged = list(store.check(manifest.number))
    if damaged:
        raise FileFormatError(
            store.location,
            f"{len(damaged)} of {len(manifest.tiles)} tiles of version {manifest.number} are damaged:\n"
            + "\n".join(str(error) for error in damaged[:20])
            + "\nAn older version may be whole: `semgp store versions`, `semgp store rollback`.",
        )
    report(
        f"{store.location}: all {len(manifest.tiles):,} tiles of version {manifest.number} are whole",
        tiles=len(manifest.tiles),
    )


@store_app.command
def clean(place: Path, /, *, older_than: float = 24.0) -> None:
    """Remove files that writers which died have left in a bucket; of folders, the next writer does it by itself.

    Example: semgp store clean s3://maps/drive --older-than 24

    Parameters
    ----------
    place
        The store's folder or URL.
    older_than
        Hours: files younger than that may belong to a writer at work.
    """
    require_place(place)

    from semgp.store import MapStore

    store = MapStore(place)
    gone = store.clean(3600 * older_than)
    report(f"{store.location}: {counted(gone, 'file')} removed", files_removed=gone)
