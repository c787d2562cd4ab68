"""What is read from a request before the map is asked: its body, within limits, and what it wants in return."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request


def media_of(request: Request, known: Sequence[str]) -> str:
    """Return the media type of a body; HTTPException (415) for others than those known."""
    if request.headers.get("content-encoding", "identity").lower() != "identity":
        raise HTTPException(415, "the body must not be encoded: leave out Content-Encoding.")
    media = request.headers.get("content-type", "").split(";")[0].strip().lower()
    if media not in known:
        raise HTTPException(415, f"the Content-Type must be one of {', '.join(known)}, not {media or 'left out'}.")
    return media


def wanted(request: Request, known: Sequence[str], default: str) -> str:
    """Return the first media type that a request accepts; HTTPException (406) where none is known."""
    accepted = [part.split(";")[0].strip().lower() for part in request.headers.get("accept", "*/*").split(",")]
    for media in accepted:
        if media in known:
            return media
        if media in ("*/*", "application/*"):
            return default
    raise HTTPException(406, f"Accept must name one of {', '.join(known)}.")


async def body_of(request: Request, most: int, seconds: float) -> bytes:
    """Return a body, read piece by piece; HTTPException where it is too large (413) or too slow (408)."""
    too_large = HTTPException(413, f"the body has more than {most:,} bytes: send it in parts.")
    announced = request.headers.get("content-length", "0")
    if not announced.isdecimal() or int(announced) > most:
        raise too_large
    body = bytearray()
    try:
        async with asyncio.timeout(seconds):
            async for piece in request.stream():
                body += piece
                if len(body) > most:
                    raise too_large
    except ClientDisconnect:
        raise HTTPException(400, "the body was cut off.") from None
    except TimeoutError:
        raise HTTPException(408, f"the body did not arrive within {seconds:g} s.") from None
    return bytes(body)
