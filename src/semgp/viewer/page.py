"""One self-contained page of a map: plain WebGL, no network, a bounded size."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Iterable, Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.maps.batches import query_in_batches
from semgp.maps.protocol import SemanticMap
from semgp.picture.colour import COLOUR_MAPS, GREY, by_value
from semgp.picture.view import view_of
from semgp.prediction import Prediction
from semgp.upward import Up, direction
from semgp.viewer.fields import CLASS, field_called, field_names, field_scale
from semgp.viewer.pack import bytes_per_point, packed
from semgp.viewer.state import Progress, Sample
from semgp.viewer.surface import Surface
from semgp.writers import atomic_write

MOST_BYTES = 8_000_000
"""A page is not larger than this, unless told."""

LEVELS = 3
"""Resolutions in a page, each half as fine as the one before."""

_HEADER_BYTES = 100_000
"""Room in the budget for the program and the classes."""


def page(
    semantic_map: SemanticMap,
    *,
    title: str = "Semantic map",
    resolution: float | None = None,
    field: str = CLASS,
    hide: Iterable[str] = (),
    up: Up | None = None,
    most_bytes: int = MOST_BYTES,
    progress: Progress | None = None,
) -> str:
    """Return a page (HTML) that shows a map, with everything in it: it loads nothing, from nowhere.

    The map is asked at three resolutions. Of each point, the page knows position, entropy, variance and occupancy
    where the map has them, and its most probable classes (`pack.TOP`); it colours by them, and tells them when a
    point is clicked.

    Parameters
    ----------
    semantic_map : SemanticMap
        The map.
    title : str
        Heading of the page.
    resolution : float, optional
        How far apart the points are at the finest, metres; left out, that of the map's data or what fits.
    field : str
        What the points are coloured by at first, see `semgp.viewer.fields`.
    hide : iterable of str
        Classes that are off at first, such as a ceiling.
    up : str, optional
        The axis of the world that points upwards, see `semgp.upward`; left out, what the map says.
    most_bytes : int
        The page is not larger.
    progress : callable, optional
        Called with how many points have been asked for, and of how many.

    Raises
    ------
    InputError
        An empty map, a class or field that it does not have, or a resolution that does not fit the size.
    """
    upward = direction(up or semantic_map.up)
    surface = Surface.of(semantic_map)
    probe = semantic_map.query(surface.positions[:1])
    field = field_called(probe, field)
    hidden = [semantic_map.classes.index(name) for name in hide]
    room = (most_bytes - _HEADER_BYTES) * 3 // 4 // bytes_per_point(probe)
    samples = _ask_all(semantic_map, surface, _levels(surface, resolution, room), progress)
    view = view_of(samples[0].points, up=upward)
    finest = samples[0].prediction
    described = {
        "title": title,
        "classes": _described(semantic_map.classes),
        "missing": _hex(GREY),
        "fields": {name: _scale(finest, name) for name in field_names(finest)},
        "colourMaps": {
            name: by_value(np.linspace(0, 1, 256), 0, 1, name).ravel().tolist() for name in COLOUR_MAPS
        },
        "state": {"field": field, "hidden": hidden},
        "oriented": surface.oriented,
        "up": upward.tolist(),
        "eye": view.T_world_camera[:3, 3].tolist(),
        "forward": view.T_world_camera[:3, 2].tolist(),
        "fov": view.fov,
        "aspect": view.width / view.height,
        "levels": [packed(sample) for sample in samples],
    }
    text = _filled(title, json.dumps(described, allow_nan=False))
    if len(text.encode()) > most_bytes:
        raise InputError(f"the page would take {len(text.encode()):,} bytes, more than allowed: too many classes.")
    return text


def write_page(semantic_map: SemanticMap, path: str | Path, **settings: object) -> int:
    """Write the page of a map to a file, whole or not at all; settings as for `page`. Return its size in bytes.

    Raises
    ------
    InputError
        As `page`, or a name that does not end in .html.
    """
    if Path(path).suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{path}: the name of a page ends in .html.")
    text = page(semantic_map, **settings).encode()  # type: ignore[arg-type]
    with atomic_write(path) as temporary:
        temporary.write_bytes(text)
    return len(text)


def _levels(surface: Surface, resolution: float | None, room: int) -> list[tuple[np.ndarray, float]]:
    """Return the points of each level, finest first, as many as there is room for."""
    wanted = [surface.spacing / 2, surface.spacing] if resolution is None else [resolution]
    if room < LEVELS:
        raise InputError("a page with so few bytes has no room for points: allow more bytes.")
    while True:
        finest = wanted.pop(0)
        levels = [surface.points(finest * 2**level, room) for level in range(LEVELS)]
        total = sum(len(points) for points, _ in levels)
        if total <= room and levels[0][1] == finest:
            return levels
        if resolution is not None:
            raise InputError(
                f"a page with points every {finest:g} m does not fit its size, which has room for "
                f"{room:,} points: allow more bytes or a coarser resolution."
            )
        wanted = wanted or [max(levels[0][1], finest * 1.1)]


def _ask_all(
    semantic_map: SemanticMap,
    surface: Surface,
    levels: Sequence[tuple[np.ndarray, float]],
    progress: Progress | None,
) -> list[Sample]:
    total, samples, before = sum(len(points) for points, _ in levels), [], 0
    for points, resolution in levels:

        def report(n: int, _: int, before: int = before) -> None:
            if progress is not None:
                progress(before + n, total)

        samples.append(
            Sample(points, surface.normals(points), query_in_batches(semantic_map, points, report), resolution)
        )
        before += len(points)
    return samples


def _described(classes: Classes) -> list[dict[str, str]]:
    return [{"name": n, "colour": _hex(c)} for n, c in zip(classes.names, classes.colours)]


def _scale(prediction: Prediction, name: str) -> dict[str, object] | None:
    if name == CLASS:
        return None
    scale = field_scale(prediction, name)
    return {"low": scale.low, "high": scale.high, "colourMap": scale.colour_map}


def _hex(colour: tuple[int, int, int]) -> str:
    return "#" + bytes(colour).hex()


def _filled(title: str, described: str) -> str:
    """Return the page. What names contain can end neither its script nor its data: no `<` is left in them."""
    folder = files("semgp.viewer")
    style, program = ((folder / name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
    digest = base64.b64encode(hashlib.sha256(program.encode()).digest()).decode()
    parts = {
        "title": html.escape(title),
        "style": style,
        "program": program,
        "program-digest": digest,
        "data": described.replace("<", "\\u003c"),
    }
    template = (folder / "page.html").read_text(encoding="utf-8")
    pieces = template.split("{{")
    filled = [pieces[0]]
    for piece in pieces[1:]:
        name, rest = piece.split("}}", 1)
        filled += [parts[name], rest]
    return "".join(filled)
