"""Requests to a bucket: asked again while that may help, and in words what is wrong where it does not."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

PAUSES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Seconds between one try and the next: a server that is started again is there in some of them."""

NO_FILE = "no such file"

_FINAL = re.compile(r"status code: 4(?!08|29)\d\d|builder error|redirect|not configured")
_AWAY = (
    "the server cannot be reached: look at its address, or try again later; what is published stays, and `semgp "
    "build --resume` goes on from there"
)
_PROBLEMS = {
    r"NoSuchBucket|ContainerNotFound|bucket does not exist": (
        "there is no such bucket: make it first, or look at its name"
    ),
    r"status code: 40[13]|not configured": "access is denied: the credentials are wrong, or do not allow it",
    r"169\.254\.|/latest/|computeMetadata|metadata/identity": (
        "there are no credentials: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or those of another service"
    ),
    r"BadScheme": (
        "http without encryption is not allowed: set AWS_ALLOW_HTTP=true (or AZURE_..., GOOGLE_...) where nobody "
        "listens in"
    ),
    r"kind: Connect": _AWAY,
    r"kind: (Timeout|Body)": (
        "the answer takes too long: set AWS_TIMEOUT=300s (or AZURE_..., GOOGLE_...) for more than half a minute"
    ),
    r"error sending request": _AWAY,
}


def patiently(request: Callable[[], T]) -> T:
    """Return what a request returns, asked again where the server was away or had too much to do.

    Raises
    ------
    FileNotFoundError, obstore.exceptions.BaseError, OSError
        What the request raises in the end.
    """
    from obstore import exceptions

    for pause in PAUSES:
        try:
            return request()
        except (FileNotFoundError, exceptions.AlreadyExistsError):
            raise
        except (OSError, exceptions.BaseError) as error:
            if _FINAL.search(str(error)):
                raise
        time.sleep(pause)
    return request()


def problem(error: Exception) -> str:
    """Return what is wrong and what to do, without a stop; `NO_FILE` where it is just that."""
    text = str(error)
    for pattern, words in _PROBLEMS.items():
        if re.search(pattern, text):
            return words
    return NO_FILE if isinstance(error, FileNotFoundError) else text.split("\n", 1)[0].rstrip(".")
