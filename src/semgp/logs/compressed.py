"""Images of sensor_msgs/CompressedImage, as image_transport's `compressed` and `compressedDepth` write them."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError
from semgp.logs.rvl import unpacked
from semgp.logs.stills import JPEG, PNG, decoded
from semgp.readers.images import LARGEST_IMAGE

_BITS = {
    **dict.fromkeys(("mono8", "8UC1"), "mono8"),
    **dict.fromkeys(("mono16", "16UC1"), "16UC1"),
    **dict.fromkeys(("8SC1", "16SC1", "32SC1", "32FC1", "64FC1"), "no PNG"),
}
"""What an image of one channel is, that a PNG was made of, if nothing was lost."""

_HEADER = struct.Struct("<iff")
"""What compressedDepth puts before the image: a number for the kind of quantisation, and its a and b."""

_LOSES = {
    "JPEG": "as JPEG, which changes numbers",
    "compressedDepth": "by compressedDepth, which makes large numbers 0",
}


def pixels_of_compressed(message: Any, *codecs: str) -> tuple[str, NDArray[Any]]:
    """Return the encoding, as of a sensor_msgs/Image, and the pixels of a sensor_msgs/CompressedImage.

    Parameters
    ----------
    message : CompressedImage
        The message. Its bytes say how they are compressed; its `format` says what they were before.
    codecs : str
        The compressions that do no harm to the image: PNG, JPEG, compressedDepth.

    Raises
    ------
    InputError
        Another compression, or an image that is damaged, truncated, too large, or lost something already.
    """
    data = bytes(message.data)
    before, _, after = (part.strip() for part in message.format.partition(";"))
    codec = _codec(data, after)
    if codec not in codecs:
        how = _LOSES.get(codec, f"in a way that is not known: {message.format!r}")
        raise InputError(f"it is compressed {how}. Record it as {' or '.join(codecs)}, or uncompressed.")
    if codec == "compressedDepth":
        return _depth(data, before, rvl="rvl" in after.lower())
    encoding, pixels = decoded(data)
    if encoding == "rgb8" and "compressed rgb" in after:
        return "bgr8", pixels  # OpenCV's encoder took red for blue: so the plugin reads it, too
    if _BITS.get(before, encoding) != encoding:
        raise InputError(f"it was {before} before it became a {codec} of {encoding}, which cannot hold that.")
    return encoding, pixels


def _codec(data: bytes, after: str) -> str:
    """Return how an image is compressed, "" where nobody knows."""
    if "compressedDepth" in after or data[_HEADER.size :].startswith(PNG):
        return "compressedDepth"
    return "PNG" if data.startswith(PNG) else "JPEG" if data.startswith(JPEG) else ""


def _depth(data: bytes, before: str, *, rvl: bool) -> tuple[str, NDArray[Any]]:
    """Return an image of compressedDepth: whole numbers as they are; others were a / depth + b, 0 for none."""
    if before not in ("16UC1", "mono16", "32FC1"):
        raise InputError(f"it is compressed depth of {before!r}, neither of 16UC1 nor of 32FC1.")
    if len(data) < _HEADER.size:
        raise InputError("it is damaged or truncated: it ends within its header.")
    _, a, b = _HEADER.unpack_from(data)
    encoding, raw = (_rvl if rvl else decoded)(data[_HEADER.size :])
    if encoding != "16UC1":
        raise InputError(f"its compressed depth is of {encoding}, not of 16 bits.")
    if before != "32FC1":
        return encoding, raw
    if not (math.isfinite(a) and math.isfinite(b) and a > 0):
        raise InputError(f"its depth is quantised by a = {a} and b = {b}: it is damaged.")
    depth = np.full(raw.shape, np.nan)
    seen = raw > max(b, 0)
    depth[seen] = a / (raw[seen] - b)
    return before, depth


def _rvl(data: bytes) -> tuple[str, NDArray[np.uint16]]:
    if len(data) < 8:
        raise InputError("it is damaged or truncated: it ends within its header.")
    width, height = struct.unpack_from("<II", data)
    if not 0 < width * height <= LARGEST_IMAGE:
        raise InputError(f"it declares {width} x {height} pixels.")
    return "16UC1", unpacked(data[8:], width * height).reshape(height, width)
