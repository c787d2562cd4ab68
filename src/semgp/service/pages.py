"""The viewer's page of the map that is served: made beside the queries, once a version, and kept."""

from __future__ import annotations

import html
from concurrent.futures import Future, ThreadPoolExecutor

from semgp.errors import ConflictError, InputError
from semgp.service.service import Service

MOST_SITES = 2_000_000
"""Maps with more sites get no page: `semgp view` shows them."""

PAGE_BYTES = 4_000_000

STYLE = (
    "body{font:16px/1.5 system-ui,sans-serif;max-width:52rem;margin:2rem auto;padding:0 1rem;color:#223}"
    "code,pre{background:#f2f3f5;padding:.1em .3em;border-radius:3px}pre{padding:.8em;overflow:auto}"
    "table{border-collapse:collapse}td,th{text-align:left;padding:.2em 1em .2em 0;vertical-align:top}"
    "h2{margin-top:2rem}"
)


class Pages:
    """The newest page, and a thread that makes the next one.

    Parameters
    ----------
    service : Service
        Whose map is shown.
    """

    def __init__(self, service: Service) -> None:
        self._service = service
        self._thread = ThreadPoolExecutor(1, "semgp-page")
        self._coming: Future[tuple[int, str]] | None = None
        self._made: tuple[int, str] | None = None
        self._closing = False

    def newest(self) -> tuple[int, str] | None:
        """Return version and text of the newest page, None where the first is in the making.

        Of a version without a page, one is begun. Only for the thread of the event loop.
        """
        if self._coming is not None and self._coming.done():
            self._made, self._coming = self._coming.result(), None
        if self._coming is None and (self._made is None or self._made[0] != self._service.reader.version):
            self._coming = self._thread.submit(self._page)
        return self._made

    def close(self) -> None:
        """Give up the page that is in the making."""
        self._closing = True
        self._thread.shutdown(cancel_futures=True)

    def _page(self) -> tuple[int, str]:
        from semgp.viewer import page

        version = self._service.reader.version
        try:
            with self._service.view() as (version, semantic_map):
                if len(semantic_map) > MOST_SITES:
                    raise InputError(
                        f"the map has {len(semantic_map):,} sites, too many for a page: use `semgp view`."
                    )
                title = f"{self._service.name}, version {version}"
                return version, page(semantic_map, title=title, most_bytes=PAGE_BYTES, progress=self._go_on_or_end)
        except (InputError, ConflictError) as error:
            return version, plain_page("No picture", f"<p>{html.escape(str(error))}</p><p>{LINKS}</p>")

    def _go_on_or_end(self, *_: int) -> None:
        if self._closing:
            raise InputError("the service is shutting down.")


LINKS = '<a href="/docs">Protocol</a> · <a href="/info">What the map is</a> · <a href="/metrics">Metrics</a>'


def plain_page(title: str, body: str, refresh: int | None = None) -> str:
    """Return a page without script; `refresh` seconds later it asks again."""
    again = "" if refresh is None else f'<meta http-equiv="refresh" content="{refresh}">'
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8">{again}<link rel="icon" href="data:,">'
        f"<title>{html.escape(title)}</title><style>{STYLE}</style></head><body><h1>{html.escape(title)}</h1>{body}"
        "</body></html>"
    )
