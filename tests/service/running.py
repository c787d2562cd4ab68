"""A service on a free port of this machine, for the length of a block."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import uvicorn

from semgp.service import Limits
from semgp.service.server import serve
from semgp.service.service import Service


@contextmanager
def running(
    location: Path, limits: Limits | None = None, token: str | None = None, **options: Any
) -> Iterator[tuple[str, Service]]:
    """Serve a map from another thread; yield the URL and the service."""
    service = Service(location, limits, **options)
    urls: list[str] = []
    servers: list[uvicorn.Server] = []
    made = uvicorn.Server

    def remember(config: uvicorn.Config) -> uvicorn.Server:
        servers.append(made(config))
        return servers[0]

    thread = threading.Thread(
        target=serve, args=(service,), kwargs={"port": 0, "token": token, "started": urls.append}
    )
    with mock.patch.object(uvicorn, "Server", remember):
        thread.start()
        while not (urls and servers and servers[0].started) and thread.is_alive():
            time.sleep(0.01)
    try:
        yield urls[0], service
    finally:
        servers[0].should_exit = True
        thread.join()
