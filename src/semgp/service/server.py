"""The server: a service on a port, until it is told to stop."""

from __future__ import annotations

import math
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from semgp.errors import InputError, MissingExtraError
from semgp.service.service import Service

if TYPE_CHECKING:
    import uvicorn


@dataclass(frozen=True)
class Ended:
    """How a service has ended.

    Parameters
    ----------
    points : int
        Points that it has answered.
    committed : int
        Clouds that it has taken in.
    dropped : int
        Clouds that waited, and were dropped.
    interrupted : bool
        Whether Ctrl-C (SIGINT) ended it, and not SIGTERM.
    """

    points: int
    committed: int
    dropped: int
    interrupted: bool


def serve(
    service: Service,
    *,
    host: str = "127.0.0.1",
    port: int = 8000,
    token: str | None = None,
    started: Callable[[str], None] | None = None,
) -> Ended:
    """Serve until SIGINT or SIGTERM; then finish the queries that run, commit the updates that wait, and return.

    A second SIGINT drops the updates. The service is closed in any case. For the main thread, or for others where
    nobody stops it.

    Parameters
    ----------
    service : Service
        What is served.
    host : str
        Where to listen; what other machines can reach needs a token.
    port : int
        0 takes any that is free.
    token : str, optional
        Callers must have it, see `semgp.service.guard`.
    started : callable, optional
        Called with the URL once connections are taken.

    Raises
    ------
    MissingExtraError
        Without the extra `serve`.
    InputError
        A host without a token, or an address that cannot be had.
    """
    require_serve()
    interrupted = drop = False
    try:
        server = _server(service, host, token)
        try:
            with _listening(host, port) as listener, _stopped_by_sigterm(server):
                if started is not None:
                    started(_url(listener))
                server.run(sockets=[listener])
        except KeyboardInterrupt:  # uvicorn ends well before it passes on the signal
            interrupted, drop = True, server.force_exit
    finally:
        dropped = _close(service, drop)
    total = service.metrics.total
    committed = total("semgp_updates_total", result="committed")
    return Ended(total("semgp_points_total"), committed, dropped, interrupted)


def require_serve() -> None:
    """Raise MissingExtraError without the extra `serve`."""
    try:
        import fastapi  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("serving a map", "serve") from error


def _server(service: Service, host: str, token: str | None) -> uvicorn.Server:
    import uvicorn

    from semgp.service.app import create_app
    from semgp.service.guard import checked_token, is_loopback

    if token is None and not is_loopback(host):
        raise InputError(f"{host} is open to other machines: give a token, with --token-file or SEMGP_TOKEN.")
    config = uvicorn.Config(
        create_app(service, None if token is None else checked_token(token)),
        http="h11",
        ws="none",
        log_config=None,
        log_level="error",
        server_header=False,
        proxy_headers=False,
        limit_concurrency=8 * service.limits.most_queries,
        timeout_keep_alive=60,
        timeout_graceful_shutdown=math.ceil(service.limits.seconds),
    )
    return uvicorn.Server(config)


def _listening(host: str, port: int) -> socket.socket:
    if not 0 <= port < 1 << 16:
        raise InputError(f"a port is a number from 0 to 65535, not {port}.")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host.strip("[]"), port), family=family, backlog=256)
    except OSError as error:
        words = error.strerror or str(error)
        raise InputError(f"cannot listen on {host}, port {port}: {words}. Choose another port.") from error


def _url(listener: socket.socket) -> str:
    host, port = listener.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


@contextmanager
def _stopped_by_sigterm(server: uvicorn.Server) -> Iterator[None]:
    """Have SIGTERM end the server and nothing else: uvicorn passes it on, which would end the process at once."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, server.handle_exit)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _close(service: Service, drop: bool) -> int:
    """Commit what waits, or drop it, as after Ctrl-C meanwhile. Return how many clouds were dropped."""
    try:
        return service.close(drop=drop)
    except KeyboardInterrupt:
        return service.close(drop=True)
