"""Portraits of maps: pictures of one view beside each other, with titles, keys and a scale bar."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.picture.camera import below_mask
from semgp.picture.compose import colour_bar, heading, legend, panels, stack
from semgp.picture.image import Colour, Picture
from semgp.picture.lettering import font, ink
from semgp.picture.paint import Bar, Paint, paint, paint_labels
from semgp.picture.splat import WHITE, disc_sizes, splat
from semgp.picture.view import View
from semgp.prediction import Prediction

RGB = "rgb"
"""The colours of scans, beside what `paint` shows."""


@dataclass(frozen=True, eq=False)
class Layer:
    """Points and how they are painted: one picture of a portrait.

    Parameters
    ----------
    points : (M, 3) array
        Metres, world frame.
    size : float or (M,) array
        Radius of the discs in metres.
    paint : Paint
        Their colours.
    """

    points: NDArray[np.float64]
    size: float | NDArray[np.float64]
    paint: Paint


def map_layers(
    points: NDArray[np.float64], resolution: float, prediction: Prediction, names: Sequence[str]
) -> list[Layer]:
    """Return the layers of a map by what they show, "rgb" left out, where it has observed anything: see `paint`.

    Parameters
    ----------
    points : (M, 3) array
        Where the map was asked, metres.
    resolution : float
        How far they are apart, metres.
    prediction : Prediction
        What it said.
    names : sequence of str
        What to show.

    Raises
    ------
    InputError
        A name that says nothing about this map.
    """
    paints = [paint(prediction, name) for name in names if name != RGB]
    if not paints or not prediction.observed.any():
        return []
    seen = points[prediction.observed]
    size = np.minimum(disc_sizes(seen), 1.2 * resolution)
    return [Layer(seen, size, replace(p, colours=p.colours[prediction.observed], missing=None)) for p in paints]


def cloud_layers(
    clouds: Sequence[LabelledCloud], names: Sequence[str], cut: float | None, up: NDArray[np.float64]
) -> list[Layer]:
    """Return the layers of the scans beside a map: their labels and, where `names` has "rgb", their colours.

    Parameters
    ----------
    clouds : sequence of LabelledCloud
        May be empty.
    names : sequence of str
        What is to be shown of the map.
    cut, up
        As in `semgp.picture.camera.below`.

    Raises
    ------
    InputError
        "rgb" without clouds that have colours.
    """
    if not clouds:
        if RGB in names:
            raise InputError("the map keeps no colours: rgb shows those of scans, so give --cloud SCANS.")
        return []
    kept = [cloud[below_mask(cloud.points, cut, up)] for cloud in clouds]
    points = np.concatenate([cloud.points for cloud in kept])
    labels = np.concatenate([cloud.hard_labels for cloud in kept])
    size = disc_sizes(points)
    larger = size * np.where(labels == MISSING, 1.0, 1.4)  # few labels among many points stay visible
    layers = [Layer(points, larger, paint_labels("labels", labels, kept[0].classes, "no label"))]
    if RGB in names:
        if any(cloud.colours is None for cloud in kept):
            raise InputError("the scans have no colours: leave rgb out.")
        colours = np.concatenate([cloud.colours for cloud in kept if cloud.colours is not None])
        layers.insert(0, Layer(points, size, Paint("colours", colours)))
    return layers


def portrait(
    layers: Sequence[Layer],
    view: View,
    *,
    title: str | None = None,
    columns: int | None = None,
    keys: bool = True,
    scale_bar: bool = True,
    background: Colour = WHITE,
) -> Picture:
    """Return one picture a layer, all from the same view, with what explains them.

    Parameters
    ----------
    layers : sequence of Layer
        At least one. The titles of their paints are written above the pictures where there are several.
    view : View
        Where they are seen from; its width and height are those of each picture.
    title : str, optional
        Written above everything.
    columns : int, optional
        Pictures in a row; left out, up to three in one row, and two rows of more.
    keys : bool
        Show legends and colour bars.
    scale_bar : bool
        Show a length that is right at the middle of the layer's points: nearer things look larger.
    background : (red, green, blue)
        Colour where there is nothing.

    Raises
    ------
    InputError
        No layers, or points and colours that do not fit each other.
    """
    if not layers:
        raise InputError("a portrait needs at least one layer.")
    size = max(13, view.width // 48)
    pictures = []
    for layer in layers:
        picture = splat(layer.points, layer.paint.colours, view, layer.size, background=background)
        if scale_bar and len(layer.points):
            picture = with_scale_bar(picture, metres_per_pixel(layer.points, view), background=background)
        if keys and isinstance(layer.paint.key, Bar):
            picture = stack([picture, _bar(layer.paint.key, view.width, size, background)], background=background)
        pictures.append(picture)
    page = pictures[0]
    if len(pictures) > 1:
        titles = [layer.paint.title for layer in layers]
        page = panels(pictures, titles, columns or _columns(len(pictures)), font_size=size, background=background)
    parts = [page]
    if title:
        parts.insert(0, heading(title, page.shape[1], font_size=round(1.3 * size), background=background))
    named = [layer.paint for layer in layers if isinstance(layer.paint.key, Classes)]
    if keys and named:
        missing = next((p.missing for p in named if p.missing), None)
        names = dict(pair for p in named if isinstance(p.key, Classes) for pair in zip(p.key.names, p.key.colours))
        parts.append(
            legend(
                Classes(tuple(names), tuple(names.values())),
                page.shape[1],
                missing=missing,
                font_size=size,
                background=background,
            )
        )
    return stack(parts, background=background)


def _columns(n: int) -> int:
    return n if n <= 3 else math.ceil(n / 2)


def metres_per_pixel(points: NDArray[np.float64], view: View) -> float:
    """Return how many metres a pixel measures at the depth of the points' middle."""
    depth = float(np.median(view.to_camera(points[:: -(-len(points) // 100_000)])[:, 2]))
    return max(depth, 1e-6) / view.focal


def with_scale_bar(picture: Picture, metres_per_pixel: float, *, background: Colour = WHITE) -> Picture:
    """Return a picture with a bar of a round length in its lower left corner, of a fifth of its width or less.

    Parameters
    ----------
    picture : (H, W, 3) uint8 array
        The picture.
    metres_per_pixel : float
        Its scale.
    background : (red, green, blue)
        What the bar is to stand out from.
    """
    height, width = picture.shape[:2]
    longest = width / 5 * metres_per_pixel
    power = 10.0 ** math.floor(math.log10(longest))
    length = max(m * power for m in (1, 2, 5) if m * power <= longest * (1 + 1e-9))
    pixels, size = round(length / metres_per_pixel), max(12, width // 60)
    page, colour = Image.fromarray(picture), ink(background)
    draw = ImageDraw.Draw(page)
    x, y, thick = size, height - size, max(2, size // 7)
    draw.line((x, y, x + pixels, y), fill=colour, width=thick)
    for end in (x, x + pixels):
        draw.line((end, y - size // 3, end, y + size // 3), fill=colour, width=thick)
    draw.text((x + pixels / 2, y - size // 2), length_in_words(length), colour, font(size), anchor="mb")
    return np.asarray(page)


def length_in_words(metres: float) -> str:
    """Return a length with the unit that suits it: "20 cm", "5 m", "2 km"."""
    for unit, scale in (("km", 1000.0), ("m", 1.0), ("cm", 0.01)):
        if metres >= scale * (1 - 1e-9):
            return f"{metres / scale:g} {unit}"
    return f"{1000 * metres:g} mm"


def _bar(key: Bar, width: int, size: int, background: Colour) -> Picture:
    return colour_bar(key.low, key.high, width=min(width, 30 * size), font_size=size, background=background)
