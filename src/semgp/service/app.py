"""The service's protocol: its paths, what they take and give, and how each error is told."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from concurrent.futures import Future
from contextlib import asynccontextmanager
from typing import Annotated, Any, Literal, TypeVar

from fastapi import FastAPI, Query, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.types import ASGIApp

from semgp.errors import ConflictError, FileFormatError, InputError
from semgp.service.answers import encode_answer
from semgp.service.clouds import decode_cloud
from semgp.service.formats import JSON, NPY, NPZ, RAW, VERSION
from semgp.service.guard import Guard
from semgp.service.limits import BusyError
from semgp.service.openapi import ABOUT, QUERY_BODY, QUERY_RESPONSES, UPDATE_BODY, UPDATE_RESPONSES
from semgp.service.pages import LINKS, Pages, plain_page
from semgp.service.points import decode_points
from semgp.service.reference import reference_page
from semgp.service.requests import body_of, media_of, wanted
from semgp.service.service import Service

T = TypeVar("T")

AGAIN = {"Retry-After": "1"}
"""For those who may try again."""

NO_SCRIPT = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; img-src data:"}

ANSWER_TO = {NPY: NPZ, RAW: RAW, JSON: JSON}
"""In what a body of each media type is answered, unless the request says."""


def create_app(service: Service, token: str | None = None) -> ASGIApp:
    """Return the ASGI application of a service.

    Parameters
    ----------
    service : Service
        The service; whoever made it closes it.
    token : str, optional
        Asked for with every request, see `Guard`.
    """
    limits, reader, pages = service.limits, service.reader, Pages(service)

    @asynccontextmanager
    async def life(_: FastAPI) -> AsyncIterator[None]:
        yield
        pages.close()

    app = FastAPI(title="semgp", description=ABOUT, docs_url=None, redoc_url=None, lifespan=life)
    _tell_errors(app)

    async def answer(future: Future[T]) -> T:
        """Wait for the map; what has not begun in time is not begun."""
        try:
            return await asyncio.wait_for(asyncio.wrap_future(future), limits.seconds)
        except TimeoutError:
            reason = f"no answer within {limits.seconds:g} s: ask about fewer points, or try again later."
            raise HTTPException(503, reason, AGAIN) from None

    @app.post("/query", openapi_extra=QUERY_BODY, responses=QUERY_RESPONSES, response_class=Response)
    async def query(
        request: Request,
        dtype: Annotated[Literal["float32", "float64"], Query(description="Numbers of raw rows.")] = "float32",
    ) -> Response:
        """Class probabilities and uncertainty at points, metres, frame of the map. All are of one version."""
        media = media_of(request, (NPY, RAW, JSON))
        give = wanted(request, (NPZ, RAW, JSON), ANSWER_TO[media])
        most = limits.most_json_bytes if media == JSON else limits.most_bytes
        with service.queries.one():
            body = await body_of(request, most, limits.seconds)
            points = await asyncio.to_thread(decode_points, body, media, dtype)
            if len(points) > limits.most_points:
                raise HTTPException(
                    413, f"{len(points):,} points, but {limits.most_points:,} a call: ask in parts."
                )
            version, prediction = await answer(reader.query(points))
            content, headers = await asyncio.to_thread(encode_answer, prediction, give)
        return Response(content, headers={VERSION: str(version), **headers}, media_type=give)

    @app.post("/update", openapi_extra=UPDATE_BODY, responses=UPDATE_RESPONSES, response_class=Response)
    async def update(
        request: Request,
        wait: Annotated[bool, Query(description="Answer once queries are answered from the new version.")] = True,
    ) -> Response:
        """Add a labelled cloud to the map, as a new version."""
        writer = service.writer
        if writer is None:
            raise HTTPException(409, service.why_read_only)
        media_of(request, (NPZ, RAW))
        with service.updates.one():
            body = await body_of(request, limits.most_bytes, limits.seconds)
            cloud = await asyncio.to_thread(decode_cloud, body, reader.classes, limits.most_unpacked)
            future = writer.update(cloud)
            if wait:
                try:  # the cloud is taken in, whether somebody waits for it or not
                    version = await asyncio.wait_for(asyncio.shield(asyncio.wrap_future(future)), limits.seconds)
                    return JSONResponse({"version": version}, headers={VERSION: str(version)})
                except TimeoutError:
                    pass
        return JSONResponse({"waiting": writer.waiting}, 202)

    @app.get("/info", response_class=Response)
    async def info() -> Response:
        """What the map is, and what the service allows."""
        described = await answer(reader.ask(lambda semantic_map: semantic_map.info()))
        return JSONResponse({"colours": reader.classes.colours, **service.facts(), **described})

    @app.get("/healthz")
    async def healthz() -> dict[str, str]:
        """Whether the process answers. Needs no token."""
        return {"status": "ok"}

    @app.get("/readyz", response_class=Response)
    async def readyz() -> Response:
        """Whether queries and updates are taken. Needs no token."""
        ready = service.is_ready
        return JSONResponse({"status": "ready" if ready else "stopping"}, 200 if ready else 503)

    @app.get("/metrics", response_class=PlainTextResponse)
    async def metrics() -> Response:
        """Counts in Prometheus' text format."""
        return Response(service.metrics_text(), media_type="text/plain; version=0.0.4; charset=utf-8")

    @app.get("/docs", include_in_schema=False)
    async def docs() -> Response:
        return HTMLResponse(reference_page(app.openapi()), headers=NO_SCRIPT)

    @app.get("/", include_in_schema=False)
    async def page() -> Response:
        made = pages.newest()
        if made is None:
            waiting = plain_page("semgp", f"<p>The picture of the map is in the making.</p><p>{LINKS}</p>", 2)
            return HTMLResponse(waiting, headers=NO_SCRIPT)
        return HTMLResponse(made[1], headers={VERSION: str(made[0])})

    return Guard(app, token, service.metrics, {getattr(route, "path", "") for route in app.routes})


def _tell_errors(app: FastAPI) -> None:
    """Have every error answered as {"error": reason}."""

    def told(status: int, headers: dict[str, str] | None = None) -> Any:
        return lambda _, error: JSONResponse({"error": str(error)}, status, headers)

    def refused(_: Request, error: Any) -> Response:
        return JSONResponse({"error": str(error.detail)}, error.status_code, error.headers)

    def invalid(_: Request, error: Any) -> Response:
        words = "; ".join(f"{problem['loc'][-1]}: {problem['msg']}" for problem in error.errors())
        return JSONResponse({"error": words}, 422)

    app.add_exception_handler(HTTPException, refused)
    app.add_exception_handler(RequestValidationError, invalid)
    app.add_exception_handler(InputError, told(400))
    app.add_exception_handler(FileFormatError, told(500))  # of the map, not of what was sent
    app.add_exception_handler(ConflictError, told(503, AGAIN))
    app.add_exception_handler(BusyError, told(503, AGAIN))
    app.add_exception_handler(Exception, lambda *_: JSONResponse({"error": "an error of the service."}, 500))
