"""What the pixels of a message say: depths, labels or colours, of an image that is compressed or not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.classes import MISSING, Classes
from semgp.errors import InputError
from semgp.logs.compressed import pixels_of_compressed

DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")
LABEL_ENCODINGS = ("mono8", "8UC1", "mono16", "16UC1", "16SC1", "32SC1")
COLOUR_ENCODINGS = ("rgb8", "bgr8", "rgba8", "bgra8")

_PIXELS = {
    **dict.fromkeys(("mono8", "8UC1"), ("u1", 1)),
    **dict.fromkeys(("mono16", "16UC1"), ("u2", 1)),
    **{"16SC1": ("i2", 1), "32SC1": ("i4", 1), "32FC1": ("f4", 1)},
    **dict.fromkeys(("rgb8", "bgr8"), ("u1", 3)),
    **dict.fromkeys(("rgba8", "bgra8"), ("u1", 4)),
}


def depth_of(message: Any) -> NDArray[np.floating[Any]]:
    """Return a depth image (H, W) in metres: whole numbers are millimetres, as in ROS REP-118."""
    encoding, pixels = _read(message, "depth", DEPTH_ENCODINGS, "PNG", "compressedDepth")
    return pixels if encoding == "32FC1" else pixels / 1000


def labels_of(message: Any, classes: Classes | None) -> NDArray[np.int64]:
    """Return a label image (H, W), `MISSING` where there is none.

    Pixels are raw ids where the classes have some, else class numbers, of which the largest of an unsigned type
    and negative ones are missing.
    """
    _, raw = _read(message, "label", LABEL_ENCODINGS, "PNG")
    if classes is not None and classes.ids:
        return classes.from_ids(raw)
    missing = raw == np.iinfo(raw.dtype).max if raw.dtype.kind == "u" else raw < 0
    return np.where(missing, MISSING, raw.astype(np.int64))


def colours_of(message: Any) -> NDArray[np.uint8]:
    """Return a colour image (H, W, 3): red, green, blue."""
    encoding, pixels = _read(message, "colour", COLOUR_ENCODINGS, "PNG", "JPEG")
    return pixels[..., 2::-1] if encoding.startswith("bgr") else pixels[..., :3]


def _read(message: Any, what: str, encodings: Sequence[str], *codecs: str) -> tuple[str, NDArray[Any]]:
    """Return the encoding and the pixels of an image of either type.

    Raises
    ------
    InputError
        An encoding that is not among those given, a compression that is not, or bytes that do not make an image.
    """
    try:
        if hasattr(message, "format"):
            encoding, pixels = pixels_of_compressed(message, *codecs)
        else:
            encoding, pixels = message.encoding, None
        if encoding not in encodings:
            raise InputError(f"it is {encoding!r}, not one of {', '.join(encodings)}.")
        return encoding, pixels_of_image(message) if pixels is None else pixels
    except InputError as error:
        raise InputError(f"its {what} image cannot be read: {error}") from error


def pixels_of_image(message: Any) -> NDArray[Any]:
    """Return the pixels of a sensor_msgs/Image, (H, W) or (H, W, channels), in the machine's byte order.

    Raises
    ------
    InputError
        Fewer bytes than pixels.
    """
    kind, channels = _PIXELS[message.encoding]
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width, step = int(message.height), int(message.width), int(message.step)
    size = dtype.itemsize
    if step < width * channels * size:
        raise InputError(f"it has rows of {step} bytes, too few for {width} pixels.")
    data = np.frombuffer(message.data, dtype=np.uint8)
    if len(data) < height * step:
        raise InputError(f"it has {len(data)} bytes where {height} rows need {height * step}.")
    if not (height and width):
        raise InputError("it has no pixels.")
    strides = (step, channels * size, size)
    view = np.ndarray((height, width, channels), dtype, data, strides=strides).astype(dtype.newbyteorder("="))
    return view[..., 0] if channels == 1 else view
