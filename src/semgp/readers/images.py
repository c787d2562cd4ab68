"""Images of a data set: depth, labels and colour, checked before and after they are decoded."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import FileFormatError

LARGEST_IMAGE = 50_000_000
"""An image whose header declares more pixels is refused before it is decoded."""

NO_RETURN = (0, 65535)
"""Values of a depth image that mean that the sensor measured nothing."""

DEPTH, LABEL, RGB = ("I;16", "I;16B", "I"), ("L", "I;16", "I;16B", "I"), ("RGB",)
"""Pillow's modes of what is read: 16 bits a pixel, 8 or 16 bits, three channels."""


def read_depth(path: Path, units_per_metre: float = 1000.0) -> NDArray[np.float64]:
    """Return a 16-bit depth image in metres, shape (H, W); NaN where it says `NO_RETURN`.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, truncated or no 16-bit image.
    """
    depth = _decoded(path, "16-bit depth image", DEPTH)
    return np.where(np.isin(depth, NO_RETURN), np.nan, depth / units_per_metre)


def read_label_image(
    path: Path, shape: tuple[int, int] | None = None, *, wide: bool = False
) -> NDArray[np.integer[Any]]:
    """Return a grey image of class ids, of the shape (H, W) that is expected.

    Parameters
    ----------
    path : Path
        The file.
    shape : (int, int), optional
        Rows and columns; left out, any.
    wide : bool
        Take images of 16 bits a pixel, too.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, truncated, of another shape or no grey image.
    """
    return _decoded(path, "label image", LABEL if wide else LABEL[:1], shape)


def read_colour_image(path: Path, shape: tuple[int, int] | None = None) -> NDArray[np.uint8]:
    """Return a colour image, shape (H, W, 3), of the height and width that are expected; left out, of any.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, truncated, of another shape or no RGB image.
    """
    return _decoded(path, "RGB image", RGB, shape)


def _decoded(path: Path, kind: str, modes: tuple[str, ...], shape: tuple[int, int] | None = None) -> NDArray[Any]:
    from PIL import Image

    try:
        with Image.open(path, formats=("PNG", "JPEG")) as image:
            found = (image.height, image.width)
            if image.mode not in modes:
                raise FileFormatError(path, f"is no {kind}, but of mode {image.mode}.")
            if shape is not None and found != shape:
                raise FileFormatError(path, f"is an image of {found} pixels, where {shape} are expected.")
            if image.height * image.width > LARGEST_IMAGE:
                raise FileFormatError(path, f"declares {found} pixels, more than any sensor has.")
            return np.array(image)
    except FileNotFoundError as error:
        raise FileFormatError(path, "no such file.") from error
    except FileFormatError:
        raise
    except (OSError, SyntaxError, ValueError, EOFError, struct.error, Image.DecompressionBombError) as error:
        raise FileFormatError(path, f"is damaged or truncated: {error}") from error
