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
"""Values of a depth image in millimetres that mean that the sensor measured nothing."""


def read_depth_mm(path: Path) -> NDArray[np.float64]:
    """Return a 16-bit depth image in millimetres as metres, shape (H, W); NaN where it says `NO_RETURN`.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, truncated or no 16-bit image.
    """
    millimetres = _decoded(path, "16-bit depth image", ("I;16", "I;16B", "I"))
    return np.where(np.isin(millimetres, NO_RETURN), np.nan, millimetres / 1000)


def read_label_image(path: Path, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Return an 8-bit image of class ids, of the shape (H, W) that is expected.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, truncated, of another shape or no 8-bit grey image.
    """
    return _decoded(path, "8-bit label image", ("L",), shape)


def read_colour_image(path: Path, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Return a colour image, shape (H, W, 3), of the height and width that are expected.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged, truncated, of another shape or no RGB image.
    """
    return _decoded(path, "RGB image", ("RGB",), shape)


def _decoded(path: Path, kind: str, modes: tuple[str, ...], shape: tuple[int, int] | None = None) -> NDArray[Any]:
    from PIL import Image

    try:
        with Image.open(path, formats=("PNG", "JPEG")) as image:
            found = (image.height, image.width)
            if image.mode not in modes:
                raise FileFormatError(path, f"is no {kind}, but of mode {image.mode}.")
            if shape is not None and found != shape:
                raise FileFormatError(path, f"is an image of {found} pixels, not {shape} like the depth.")
            if image.height * image.width > LARGEST_IMAGE:
                raise FileFormatError(path, f"declares {found} pixels, more than any sensor has.")
            return np.array(image)
    except FileNotFoundError as error:
        raise FileFormatError(path, "no such file.") from error
    except FileFormatError:
        raise
    except (OSError, SyntaxError, ValueError, EOFError, struct.error, Image.DecompressionBombError) as error:
        raise FileFormatError(path, f"is damaged or truncated: {error}") from error
