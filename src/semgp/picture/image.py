"""Pictures as arrays: what they are, and how they become files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgp.errors import InputError
from semgp.writers import atomic_write

Colour = tuple[int, int, int]
Picture = NDArray[np.uint8]


def checked_picture(image: Picture) -> Picture:
    """Return the image if it is a picture.

    Raises
    ------
    InputError
        An array that is not uint8 of shape (H, W, 3), or is empty.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or not image.size:
        raise InputError(
            f"a picture is uint8 of shape (height, width, 3), not {image.dtype} of shape {image.shape}."
        )
    return image


def save_png(path: str | Path, image: Picture) -> None:
    """Write a picture (H, W, 3) to a PNG file, which is whole or not there.

    Raises
    ------
    InputError
        An array that is no picture, a name that does not end in .png, or a folder that does not exist.
    """
    picture = Image.fromarray(checked_picture(image))
    require_png(path)
    with atomic_write(path) as temporary:
        picture.save(temporary, format="PNG", compress_level=6)


def require_png(path: str | Path) -> None:
    """Check the name of a picture's file.

    Raises
    ------
    InputError
        A name that does not end in .png.
    """
    if Path(path).suffix.lower() != ".png":
        raise InputError(f"{path}: the name of a PNG file ends in .png.")
