"""Putting pictures together: titled grids, class legends, colour bars."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.picture.colour import GREY, by_value
from semgp.picture.image import Colour, Picture, checked_picture
from semgp.picture.lettering import blank, font, ink, write
from semgp.picture.splat import WHITE


def panels(
    images: Sequence[Picture],
    titles: Sequence[str] | None = None,
    columns: int | None = None,
    *,
    font_size: int = 24,
    background: Colour = WHITE,
) -> Picture:
    """Return pictures in a grid, each centred in its cell below its title.

    Parameters
    ----------
    images : sequence of (H, W, 3) uint8 arrays
        The pictures, row by row.
    titles : sequence of str, optional
        One a picture.
    columns : int, optional
        Pictures in a row; left out, as many rows as columns, or one fewer.
    font_size : int
        Height of the letters in pixels; the gaps go with it.
    background : (red, green, blue)
        Colour of what the pictures leave free. The titles are dark on light or light on dark.

    Raises
    ------
    InputError
        No pictures, arrays that are no pictures, or titles that do not fit them.
    """
    pictures = [checked_picture(image) for image in images]
    if not pictures:
        raise InputError("a grid needs at least one picture.")
    if titles is not None and len(titles) != len(pictures):
        raise InputError(f"{len(titles)} titles for {len(pictures)} pictures: give one each.")
    columns = math.ceil(math.sqrt(len(pictures))) if columns is None else columns
    if columns < 1:
        raise InputError(f"a grid has at least one column, not {columns}.")
    columns = min(columns, len(pictures))
    gap, head = font_size, 0 if titles is None else 2 * font_size
    cell_height = max(len(p) for p in pictures) + head + gap
    cell_width = max(p.shape[1] for p in pictures) + gap
    rows = math.ceil(len(pictures) / columns)
    page = blank(rows * cell_height + gap, columns * cell_width + gap, background)
    for i, picture in enumerate(pictures):
        left, top = gap + i % columns * cell_width, gap + i // columns * cell_height
        inset = (cell_width - gap - picture.shape[1]) // 2
        page.paste(Image.fromarray(picture), (left + inset, top + head))
        if titles is not None:
            middle = (left + (cell_width - gap) / 2, top + 0.7 * font_size)
            write(page, middle, titles[i], font_size, background, anchor="mm")
    return np.asarray(page)


def stack(images: Sequence[Picture], *, background: Colour = WHITE) -> Picture:
    """Return pictures below each other, centred: a grid and its legend, say.

    Raises
    ------
    InputError
        No pictures, or arrays that are no pictures.
    """
    pictures = [checked_picture(image) for image in images]
    if not pictures:
        raise InputError("a stack needs at least one picture.")
    width = max(p.shape[1] for p in pictures)
    page = blank(sum(len(p) for p in pictures), width, background)
    top = 0
    for picture in pictures:
        page.paste(Image.fromarray(picture), ((width - picture.shape[1]) // 2, top))
        top += len(picture)
    return np.asarray(page)


def legend(
    classes: Classes,
    width: int | None = None,
    *,
    missing: str | None = None,
    font_size: int = 24,
    background: Colour = WHITE,
) -> Picture:
    """Return the classes' colours with their names.

    Parameters
    ----------
    classes : Classes
        What to show, in this order.
    width : int, optional
        Width of the legend in pixels, filled with as many columns as fit; one column if left out.
    missing : str, optional
        What to call the colour of missing labels, such as "no label"; left out, it is not shown.
    font_size : int
        Height of the letters in pixels.
    background : (red, green, blue)
        Colour of the ground.
    """
    entries = [*zip(classes.names, classes.colours)]
    if missing is not None:
        entries.append((missing, GREY))
    swatch, line, margin = font_size, round(1.6 * font_size), font_size
    longest = max(font(font_size).getlength(name) for name, _ in entries)
    column = math.ceil(longest + 2.6 * swatch)
    fitting = 1 if width is None else max(1, (width - 2 * margin) // column)
    rows = math.ceil(len(entries) / fitting)
    columns = math.ceil(len(entries) / rows)
    full = columns * column + 2 * margin
    page = blank(rows * line + margin, full if width is None else max(width, full), background)
    draw = ImageDraw.Draw(page)
    first = (page.width - columns * column + swatch) // 2
    for i, (name, colour) in enumerate(entries):
        x, y = first + i % columns * column, margin // 2 + i // columns * line + (line - swatch) // 2
        draw.rounded_rectangle((x, y, x + swatch, y + swatch), radius=swatch // 5, fill=colour)
        write(page, (x + 1.5 * swatch, y + swatch / 2), name, font_size, background, anchor="lm")
    return np.asarray(page)


def colour_bar(
    low: float,
    high: float,
    title: str = "",
    *,
    colour_map: str = "viridis",
    width: int = 480,
    font_size: int = 24,
    background: Colour = WHITE,
) -> Picture:
    """Return a horizontal bar of a colour map with ticks at round numbers.

    Parameters
    ----------
    low, high : float
        Values at the two ends.
    title : str
        What the values are, written above the bar.
    colour_map : str
        As for `by_value`.
    width : int
        Width of the picture in pixels.
    font_size : int
        Height of the letters in pixels.
    background : (red, green, blue)
        Colour of the ground.

    Raises
    ------
    InputError
        Ends that are not finite or not in order, or no room for the bar.
    """
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"the ends of a colour bar must be finite and in order, not {low} and {high}.")
    margin, thick = 2 * font_size, font_size
    length = width - 2 * margin
    if length < 2:
        raise InputError(f"a colour bar with letters of {font_size} pixels needs a width above {2 * margin}.")
    top = round(1.8 * font_size) if title else font_size // 2
    page = blank(top + thick + 2 * font_size, width, background)
    bar = by_value(np.linspace(low, high, length), low, high, colour_map)
    page.paste(Image.fromarray(np.repeat(bar[None], thick, axis=0)), (margin, top))
    draw = ImageDraw.Draw(page)
    colour = ink(background)
    for value in _ticks(low, high, max(2, length // (4 * font_size))):
        x = margin + round((value - low) / (high - low) * (length - 1))
        draw.line((x, top + thick, x, top + thick + font_size // 4), fill=colour, width=max(1, font_size // 12))
        write(page, (x, top + thick + 1.1 * font_size), f"{value:g}", font_size, background, anchor="mm")
    write(page, (width / 2, 0.9 * font_size), title, font_size, background, anchor="mm")
    return np.asarray(page)


def heading(text: str, width: int, *, font_size: int = 24, background: Colour = WHITE) -> Picture:
    """Return a line of text on a ground of so many pixels' width."""
    page = blank(2 * font_size, width, background)
    write(page, (width / 2, 1.1 * font_size), text, font_size, background, anchor="mm")
    return np.asarray(page)


def _ticks(low: float, high: float, most: int) -> list[float]:
    """Return at most `most` + 1 multiples of 1, 2 or 5 times a power of ten between two values."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]
