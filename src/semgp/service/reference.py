"""The service's /docs: its OpenAPI schema as a plain page, which loads nothing from anywhere."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from typing import Any

from semgp.service.pages import plain_page


def reference_page(schema: Mapping[str, Any]) -> str:
    """Return the page (HTML) of an OpenAPI schema."""
    body = "".join(
        "".join(_operation(path, method, operation))
        for path, methods in schema["paths"].items()
        for method, operation in methods.items()
    )
    about = _text(schema["info"].get("description", ""))
    return plain_page(schema["info"]["title"], f'{about}<p><a href="/openapi.json">OpenAPI schema</a></p>{body}')


def _operation(path: str, method: str, operation: Mapping[str, Any]) -> Iterator[str]:
    yield f"<h2><code>{method.upper()} {html.escape(path)}</code></h2>{_text(operation.get('description', ''))}"
    rows = [(p["name"], p.get("description", "")) for p in operation.get("parameters", ())]
    yield _table("Parameters", rows)
    yield _table("Body", _media(operation.get("requestBody", {})))
    for status, response in sorted(operation["responses"].items()):
        headers = [(name, header["description"]) for name, header in response.get("headers", {}).items()]
        rows = [*_media(response), *headers] if status < "400" else []  # errors are all alike
        yield f"<h4>{status}: {html.escape(response['description'])}</h4>{_table('', rows)}"


def _media(part: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        (media, content.get("schema", {}).get("description", ""))
        for media, content in part.get("content", {}).items()
    ]


def _table(title: str, rows: list[tuple[str, str]]) -> str:
    if not rows:
        return ""
    cells = "".join(f"<tr><td><code>{html.escape(a)}</code></td><td>{html.escape(b)}</td></tr>" for a, b in rows)
    return (f"<h4>{title}</h4>" if title else "") + f"<table>{cells}</table>"


def _text(words: str) -> str:
    return "".join(f"<p>{html.escape(paragraph)}</p>" for paragraph in words.split("\n\n") if paragraph.strip())
