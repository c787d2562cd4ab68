"""A client of the service: Python's own HTTP and arrays, nothing else."""

from __future__ import annotations

import http.client
import json
import ssl
from types import TracebackType
from typing import Any, Self
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import ArrayLike

from semgp.cloud import LabelledCloud
from semgp.errors import InputError, SemgpError
from semgp.prediction import Prediction
from semgp.readers.npz import DAMAGE
from semgp.service.answers import decode_answer
from semgp.service.clouds import encode_cloud
from semgp.service.formats import NPZ, RAW, VERSION


class UnavailableError(SemgpError):
    """A service that cannot be reached, is too busy, or has failed: the request may be sent again."""


class Client:
    """A service that answers as a map does.

    It keeps one connection, and is for one thread at a time.

    >>> with Client("http://127.0.0.1:8000") as room:  # doctest: +SKIP
    ...     room.update(cloud)
    ...     room.query(points).label

    Parameters
    ----------
    url : str
        Where the service is.
    token : str, optional
        Its token.
    seconds : float
        How long to wait for an answer.

    Attributes
    ----------
    version : int or None
        The version of the map that the last answer came from.

    Raises
    ------
    InputError
        What is no http or https URL.
    """

    def __init__(self, url: str, token: str | None = None, *, seconds: float = 120.0) -> None:
        self.url = url.rstrip("/")
        self.version: int | None = None
        parts = urlsplit(url)
        if parts.scheme not in ("http", "https") or parts.hostname is None:
            raise InputError(f"{url} is no URL of a service, such as http://127.0.0.1:8000.")
        self._path = parts.path.rstrip("/")
        self._headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._connection = (
            http.client.HTTPConnection(parts.hostname, parts.port, timeout=seconds)
            if parts.scheme == "http"
            else http.client.HTTPSConnection(
                parts.hostname, parts.port, timeout=seconds, context=ssl.create_default_context()
            )
        )

    def query(self, points: ArrayLike) -> Prediction:
        """Return class probabilities and uncertainty at points (M, 3), metres: what the map itself answers.

        Raises
        ------
        InputError
            What the service refuses; UnavailableError where it cannot be reached.
        """
        rows = np.ascontiguousarray(points, dtype="<f8")
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise InputError(f"query points must have shape (M, 3), not {rows.shape}.")
        content = self._ask("POST", "/query?dtype=float64", rows.tobytes(), RAW, NPZ)
        try:
            return decode_answer(content)
        except DAMAGE as error:
            raise UnavailableError(f"{self.url} gave what is no answer: {error}") from error

    def update(self, cloud: LabelledCloud, *, wait: bool = True) -> int | None:
        """Add a cloud, and return the version of the map that has it; None where the cloud waits its turn.

        Parameters
        ----------
        cloud : LabelledCloud
            Of the map's classes.
        wait : bool
            Until queries are answered from the new version.

        Raises
        ------
        InputError
            What the service refuses; UnavailableError where it cannot be reached.
        """
        path = "/update" if wait else "/update?wait=false"
        version: int | None = self._facts("POST", path, encode_cloud(cloud), NPZ).get("version")
        return version

    def info(self) -> dict[str, Any]:
        """Return what the map is, and what the service allows.

        Raises
        ------
        UnavailableError
            It cannot be reached.
        """
        return self._facts("GET", "/info")

    def close(self) -> None:
        """Close the connection; the next call opens another one."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _facts(self, method: str, path: str, body: bytes | None = None, media: str = "") -> dict[str, Any]:
        """Return what is answered in JSON."""
        content = self._ask(method, path, body, media)
        try:
            facts: dict[str, Any] = json.loads(content)
        except ValueError as error:
            raise UnavailableError(f"{self.url} gave what is no answer: {error}") from error
        return facts

    def _ask(self, method: str, path: str, body: bytes | None = None, media: str = "", accept: str = "") -> bytes:
        wishes = {"Content-Type": media, "Accept": accept}
        headers = self._headers | {name: value for name, value in wishes.items() if value}
        try:
            response = self._response(method, self._path + path, body, headers)
            content = response.read()
        except (OSError, http.client.HTTPException) as error:
            self.close()
            raise UnavailableError(f"{self.url} cannot be reached: {error}. Is `semgp serve` running?") from error
        if response.status >= 500:
            raise UnavailableError(f"{self.url}: {_reason(content, response)}")
        if response.status >= 400:
            raise InputError(f"{self.url}: {_reason(content, response)}")
        if version := response.headers.get(VERSION):
            self.version = int(version)
        return content

    def _response(
        self, method: str, path: str, body: bytes | None, headers: dict[str, str]
    ) -> http.client.HTTPResponse:
        """Send a request; once more where the service has closed a connection that it kept from before."""
        kept = self._connection.sock is not None
        try:
            self._connection.request(method, path, body, headers)
            return self._connection.getresponse()
        except (http.client.RemoteDisconnected, BrokenPipeError, ConnectionResetError):
            self.close()
            if not kept:
                raise
        self._connection.request(method, path, body, headers)
        return self._connection.getresponse()


def _reason(content: bytes, response: http.client.HTTPResponse) -> str:
    """The reason in an answer, or its status where it has none."""
    try:
        return str(json.loads(content)["error"])
    except (ValueError, KeyError, TypeError):
        return f"{response.status} {response.reason}"
