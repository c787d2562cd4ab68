"""One self-contained page of a map: plain WebGL, no network, a bounded size."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.maps.protocol import SemanticMap
from semgp.picture.colour import COLOUR_MAPS, GREY, by_value
from semgp.picture.view import view_of
from semgp.prediction import Prediction
from semgp.upward import Up, direction
from semgp.viewer.fields import CLASS, field_called, field_names, field_scale
from semgp.viewer.levels import ask_all, levels
from semgp.viewer.pack import bytes_per_point, packed
from semgp.viewer.sample import Progress
from semgp.viewer.surface import Surface
from semgp.viewer.template import filled
from semgp.writers import atomic_write

MOST_BYTES = 8_000_000
"""A page is not larger than this, unless told."""

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
    samples = ask_all(semantic_map, surface, levels(surface, resolution, room), progress)
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
        "seeInside": any(bool(sample.one_sided.any()) for sample in samples),
        "up": upward.tolist(),
        "eye": view.T_world_camera[:3, 3].tolist(),
        "forward": view.T_world_camera[:3, 2].tolist(),
        "fov": view.fov,
        "aspect": view.width / view.height,
        "levels": [packed(sample) for sample in samples],
    }
    text = filled(title, json.dumps(described, allow_nan=False))
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


def _described(classes: Classes) -> list[dict[str, str]]:
    return [{"name": n, "colour": _hex(c)} for n, c in zip(classes.names, classes.colours)]


def _scale(prediction: Prediction, name: str) -> dict[str, object] | None:
    if name == CLASS:
        return None
    scale = field_scale(prediction, name)
    return {"low": scale.low, "high": scale.high, "colourMap": scale.colour_map}


def _hex(colour: tuple[int, int, int]) -> str:
    return "#" + bytes(colour).hex()
