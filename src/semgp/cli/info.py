"""`semgp info`: what a map is, for people; `--json` has its facts as they are."""

from __future__ import annotations

from pathlib import Path

from semgp.cli.places import named, require_place


def info(map_place: Path, /) -> None:
    """Show what a map is: kind, classes, extent, size, free space, model; of a store, its version too.

    Example: semgp info room.semgp

    Parameters
    ----------
    map_place
        A map that `semgp build` wrote: a file, or a store.
    """
    require_place(map_place)

    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    from semgp.cli.console import report
    from semgp.cli.describe import kind_of, rows_of
    from semgp.maps.files import load_map

    semantic_map = load_map(map_place)
    facts = semantic_map.info()
    title = Text(f"{named(map_place)}: {kind_of(semantic_map)}", style="bold")
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for name, words in rows_of(semantic_map, facts, map_place):
        table.add_row(name, Text(words))
    report(Group(title, table), **facts)
