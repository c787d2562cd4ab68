"""The live viewer's web server: viser's, at the port that was asked for, and silent."""

from __future__ import annotations

import contextlib
import io
import socket
from collections.abc import Iterator
from typing import TYPE_CHECKING

from semgp.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    import viser


def start_server(host: str, port: int) -> viser.ViserServer:
    """Start viser's server, at this port or not at all.

    Raises
    ------
    InputError
        Nothing can listen there.
    MissingExtraError
        The extra `view` is not installed.
    """
    try:
        import viser
    except ImportError as error:
        raise MissingExtraError("the live viewer", "view") from error
    try:  # viser itself would go on to the next port
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except (OSError, OverflowError) as error:
        problem = getattr(error, "strerror", None) or error
        raise InputError(f"cannot listen at {host}:{port}: {problem}. Give another --port or --host.") from error
    with _silenced():
        return viser.ViserServer(host=host, port=port, verbose=False)


def stop_server(server: viser.ViserServer) -> None:
    """Stop the server and its threads."""
    with _silenced():
        server.stop()


@contextlib.contextmanager
def _silenced() -> Iterator[None]:
    """Keep viser from printing that it starts and stops."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
