"""The self-contained page without its data: HTML, style and program as one text."""

from __future__ import annotations

import base64
import hashlib
import html
from importlib.resources import files

_PROGRAM = ("data.js", "camera.js", "shaders.js", "drawing.js", "reading.js", "controls.js", "input.js")
"""Parts of the program, in order."""


def filled(title: str, described: str) -> str:
    """Return the page. What names contain can end neither its script nor its data: no `<` is left in them."""
    program = "\n".join(map(_read, _PROGRAM))
    digest = base64.b64encode(hashlib.sha256(program.encode()).digest()).decode()
    parts = {
        "title": html.escape(title),
        "style": _read("page.css"),
        "program": program,
        "program-digest": digest,
        "data": described.replace("<", "\\u003c"),
    }
    pieces = _read("page.html").split("{{")
    filled = [pieces[0]]
    for piece in pieces[1:]:
        name, rest = piece.split("}}", 1)
        filled += [parts[name], rest]
    return "".join(filled)


def _read(name: str) -> str:
    return (files("semgp.viewer") / "web" / name).read_text(encoding="utf-8")
