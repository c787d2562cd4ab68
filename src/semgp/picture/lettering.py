"""Letters on pictures: their font, their colour, and the page they are written on."""

from __future__ import annotations

from PIL import Image, ImageDraw, ImageFont

from semgp.picture.image import Colour


def blank(height: int, width: int, background: Colour) -> Image.Image:
    """Return a page of one colour."""
    return Image.new("RGB", (width, height), background)


def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return the font of all that is written, with letters of so many pixels."""
    return ImageFont.load_default(size)


def ink(background: Colour) -> Colour:
    """Return a text colour that reads well: near black on light, near white on dark."""
    red, green, blue = background
    return (34, 34, 38) if 0.299 * red + 0.587 * green + 0.114 * blue > 128 else (236, 236, 236)


def write(
    page: Image.Image, at: tuple[float, float], text: str, size: int, background: Colour, anchor: str
) -> None:
    """Write a line of text, `at` its middle (anchor "mm") or the middle of its left end ("lm")."""
    ImageDraw.Draw(page).text(at, text, ink(background), font(size), anchor=anchor)
