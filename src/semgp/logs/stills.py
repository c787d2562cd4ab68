"""PNG and JPEG images in messages: their pixels, and nothing else that they carry."""

from __future__ import annotations

import struct
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.readers.images import LARGEST_IMAGE

PNG, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
"""What files of either kind begin with."""

_PNG_ENCODINGS = {(0, 8): "mono8", (0, 16): "16UC1", (2, 8): "rgb8", (2, 16): "rgb8", (6, 8): "rgb8"}
"""Encodings of sensor_msgs/Image for PNG's colour types and bits; alpha is dropped, 16 bits a colour cut to 8."""

_JPEG_ENCODINGS = {"L": "mono8", "RGB": "rgb8"}


def decoded(data: bytes) -> tuple[str, NDArray[Any]]:
    """Return the encoding, as of a sensor_msgs/Image, and the pixels (H, W) or (H, W, 3) of a PNG or JPEG.

    Raises
    ------
    InputError
        A file that is damaged, truncated, too large or of another kind.
    """
    from PIL.JpegImagePlugin import JpegImageFile
    from PIL.PngImagePlugin import PngImageFile

    # Not by Image.open, which warns of large images before they can be refused, and tries other formats.
    try:
        if data.startswith(PNG):
            width, height, bits, colour = struct.unpack_from(">IIBB", data, 16)
            encoding = _PNG_ENCODINGS.get((colour, bits), f"PNG of colour type {colour} and {bits} bits")
            image: Any = PngImageFile(BytesIO(_critical_chunks(data)))
        else:
            image = JpegImageFile(BytesIO(_without_remarks(data)))
            encoding = _JPEG_ENCODINGS.get(image.mode, f"JPEG of mode {image.mode}")
            width, height = image.size
        with image:
            if image.size != (width, height) or not 0 < width * height <= LARGEST_IMAGE:
                raise InputError(f"it declares {width} x {height} pixels.")
            return encoding, np.asarray(image.convert("RGB") if encoding == "rgb8" else image)
    except InputError:
        raise
    except Exception as error:  # damaged bytes make the decoders fail in any way
        raise InputError(f"it is damaged or truncated: {str(error) or type(error).__name__}.") from error


def _critical_chunks(data: bytes) -> bytes:
    """Return a PNG without what PNG calls ancillary chunks: texts, profiles, animation."""
    kept, at = [PNG], len(PNG)
    while at < len(data):
        (length,) = struct.unpack_from(">I", data, at)
        if not data[at + 4] & 0x20:
            kept.append(data[at : at + 12 + length])
        at += 12 + length
    return b"".join(kept)


def _without_remarks(data: bytes) -> bytes:
    """Return a JPEG without comments and applications' segments, but those that tell the colours."""
    kept, at = [data[:2]], 2
    while data[at : at + 2] != b"\xff\xda":  # up to where the scans begin
        marker = data[at + 1]
        if data[at] != 0xFF or marker < 0xC0 or 0xD0 <= marker <= 0xD9 or marker == 0xFF:
            raise InputError("it is damaged or no plain JPEG.")
        end = at + 2 + int.from_bytes(data[at + 2 : at + 4])
        if not (0xE1 <= marker <= 0xED or marker in (0xEF, 0xFE)):
            kept.append(data[at:end])
        at = end
    return b"".join([*kept, data[at:]])
