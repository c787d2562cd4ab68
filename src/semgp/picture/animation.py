"""Pictures that move: GIF, WebP and animated PNG."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from PIL import Image

from semgp.errors import InputError
from semgp.picture.image import Picture, checked_picture
from semgp.writers import atomic_write

SUFFIXES = (".gif", ".webp", ".png")
"""Names of animations end in one of these."""

_OPTIONS: dict[str, dict[str, Any]] = {
    ".gif": {"format": "GIF", "optimize": True, "disposal": 1},
    ".webp": {"format": "WEBP", "quality": 82, "method": 4},
    ".png": {"format": "PNG", "compress_level": 9},
}


def save_animation(path: str | Path, frames: Iterable[Picture], *, rate: float = 15.0) -> None:
    """Write pictures that follow each other without end to a file, which is whole or not there.

    Parameters
    ----------
    path : str or Path
        A .gif, .webp or .png file. A GIF has 256 colours; WebP is the smallest; PNG loses nothing.
    frames : iterable of (H, W, 3) uint8 arrays
        The pictures, two at least, all of one size; taken one by one.
    rate : float
        Pictures a second, up to 50.

    Raises
    ------
    InputError
        Another suffix, pictures that are none or not of one size, fewer than two, or a rate out of range.
    """
    suffix = require_animation(path)
    if not 0 < rate <= 50:
        raise InputError(f"the rate lies between 0 and 50 pictures a second, not {rate}.")
    with atomic_write(path) as temporary:
        images = [Image.fromarray(checked_picture(frame)) for frame in frames]
        if len(images) < 2 or len({image.size for image in images}) != 1:
            raise InputError("an animation needs two pictures at least, all of one size.")
        if suffix == ".gif":
            images = _with_one_palette(images)
        first, *others = images
        first.save(
            temporary, save_all=True, append_images=others, duration=round(1000 / rate), loop=0, **_OPTIONS[suffix]
        )


def require_animation(path: str | Path) -> str:
    """Return the suffix of an animation's name.

    Raises
    ------
    InputError
        A name that ends in none of `SUFFIXES`.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: the name of an animation ends in {', '.join(SUFFIXES)}.")
    return suffix


def _with_one_palette(images: list[Image.Image]) -> list[Image.Image]:
    """Return the images in 256 colours that they share: colours of their own would flicker."""
    width, height = images[0].size
    some = images[:: max(1, len(images) // 4)][:4]
    sheet = Image.new("RGB", (width, height * len(some)))
    for i, image in enumerate(some):
        sheet.paste(image, (0, i * height))
    palette = sheet.quantize(256, method=Image.Quantize.MEDIANCUT)
    return [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
