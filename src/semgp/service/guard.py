"""The gate before every request: who may come in, and how long it took."""

from __future__ import annotations

import base64
import binascii
import hmac
import ipaddress
import time
from collections.abc import Collection
from typing import Any

from starlette.datastructures import Headers
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from semgp.errors import InputError
from semgp.service.metrics import Metrics

OPEN = ("/healthz", "/readyz")
"""Paths that need no token: they tell nothing of the map."""

SHORTEST_TOKEN = 16


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach a host of that name."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def checked_token(token: str) -> str:
    """Return a token that can be one.

    Raises
    ------
    InputError
        Fewer than 16 characters, or others than printable ASCII.
    """
    if len(token) < SHORTEST_TOKEN or not all("!" <= letter <= "~" for letter in token):
        raise InputError(
            f"a token has {SHORTEST_TOKEN} printable ASCII characters or more, without spaces; one is made by: "
            "python -c 'import secrets; print(secrets.token_urlsafe())'"
        )
    return token


class Guard:
    """ASGI middleware: asks for the token, and counts requests.

    With a token, every path but `OPEN` needs it: as `Authorization: Bearer TOKEN`, or as the password of basic
    authentication, which browsers ask for. Without one the service is for this machine, and answers only requests
    that name it so: a page on the web that has its own name resolved to this machine gets nothing.

    Parameters
    ----------
    app : ASGI application
        What is behind.
    token : str or None
        The token.
    metrics : Metrics
        Where requests are counted.
    paths : collection of str
        Those that are counted by name.
    """

    def __init__(self, app: ASGIApp, token: str | None, metrics: Metrics, paths: Collection[str]) -> None:
        self.app, self.metrics, self.paths = app, metrics, frozenset(paths)
        self.token = None if token is None else token.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or have it answered."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        start, status = time.perf_counter(), 500

        async def watch(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        path = scope["path"] if scope["path"] in self.paths else "other"
        try:
            await (self._refusal(scope) or self.app)(scope, receive, watch)
        finally:
            self.metrics.count("semgp_requests_total", path=path, status=str(status))
            self.metrics.time("semgp_request_seconds", time.perf_counter() - start, path=path)

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        if scope["path"] in OPEN:
            return None
        if self.token is None:
            known = is_loopback(_host(headers.get("host", "")))
            return None if known else _refused(421, "without a token, the service is for this machine.")
        if hmac.compare_digest(_given(headers.get("authorization", "")), self.token):
            return None
        challenge: dict[str, Any] = {"WWW-Authenticate": 'Basic realm="semgp", charset="UTF-8"'}
        return _refused(401, "send the service's token: Authorization: Bearer TOKEN.", challenge)


def _host(header: str) -> str:
    """The host in a header such as localhost:8000 or [::1]:8000."""
    return header[1:].partition("]")[0] if header.startswith("[") else header.partition(":")[0]


def _given(authorization: str) -> bytes:
    """The token in a header, empty where there is none."""
    scheme, _, rest = authorization.partition(" ")
    if scheme.lower() == "bearer":
        return rest.strip().encode()
    if scheme.lower() == "basic":
        try:
            return base64.b64decode(rest, validate=True).partition(b":")[2]
        except (binascii.Error, ValueError):
            return b""
    return b""


def _refused(status: int, reason: str, headers: dict[str, Any] | None = None) -> Response:
    return JSONResponse({"error": reason}, status, headers)
