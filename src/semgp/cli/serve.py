"""`semgp serve`: a map that programs ask and people look at."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from semgp.cli.places import require_place


def serve(
    location: str,
    /,
    *,
    host: str = "127.0.0.1",
    port: int = 8000,
    token_file: Path | None = None,
    read_only: Annotated[bool, Parameter(negative="")] = False,
    keep: int | None = None,
    only_writer: Annotated[bool, Parameter(negative="")] = False,
    poll: float = 5.0,
    points: int = 1_000_000,
    megabytes: int = 64,
    timeout: float = 60.0,
    sites: int | None = None,
) -> None:
    """Answer queries and take updates over HTTP, until Ctrl-C; the address itself is a page that shows the map.

    Example: semgp serve drive

    Example: semgp serve s3://maps/drive --host 0.0.0.0 --token-file token.txt

    Parameters
    ----------
    location
        A stored map, folder or URL; or a map file, which takes no updates.
    host
        Where to listen. What other machines can reach needs a token.
    port
        0 takes any that is free.
    token_file
        A file with the token that callers must have; left out, the environment's SEMGP_TOKEN.
    read_only
        Take no updates.
    keep
        Versions that stay; of the older ones, those that the service has made are dropped as it goes. 0 keeps all;
        left out, 20 in a folder, all in a bucket.
    only_writer
        Nobody else writes to this map while it is served: only so can --keep be for a bucket.
    poll
        Seconds from one look for versions that others have made to the next; 0 for never.
    points
        The most points of a query.
    megabytes
        The most of a request's body.
    timeout
        Seconds for a request to arrive, and for its answer after that.
    sites
        Sites of a stored map that are kept in memory, for queries and again for updates.
    """
    require_place(Path(location))

    from semgp.cli.console import MANNERS, STDERR, progress, report
    from semgp.service.limits import Limits
    from semgp.service.server import require_serve
    from semgp.service.server import serve as serve_it
    from semgp.service.service import Service
    from semgp.store import MOST_SITES

    require_serve()
    token = os.environ.get("SEMGP_TOKEN") if token_file is None else token_file.read_text().strip()
    limits = Limits(most_points=points, most_bytes=megabytes << 20, seconds=timeout)
    with progress() as bars:
        bars.add_task("opening the map", total=None)
        service = Service(
            location,
            limits,
            most_sites=MOST_SITES if sites is None else sites,
            read_only=read_only,
            keep=keep,
            only_writer=only_writer,
            poll=poll,
        )

    def started(url: str) -> None:
        words = "queries and updates" if service.writer is not None else "queries, read-only"
        report(
            f"{url}: {location}, {words}; Ctrl-C ends it", url=url, map=location, version=service.reader.version
        )
        sys.stdout.flush()

    ended = serve_it(service, host=host, port=port, token=token, started=started)
    words = f"answered {ended.points:,} points, committed {ended.committed:,} updates"
    words += f", dropped {ended.dropped:,} that waited" if ended.dropped else ""
    if ended.interrupted:
        raise KeyboardInterrupt(words)
    if not MANNERS.quiet:
        STDERR.print(f"stopped: {words}", markup=False, highlight=False, soft_wrap=True)
