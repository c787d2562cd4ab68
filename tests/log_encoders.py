"""Compressed images as image_transport writes them, made number by number."""

import struct
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image


def png(pixels: NDArray[Any]) -> bytes:
    return _file(pixels, "PNG")


def jpeg(pixels: NDArray[Any], **options: Any) -> bytes:
    return _file(pixels, "JPEG", **{"quality": 95, **options})


def compressed_depth(depth: NDArray[Any], codec: str, *, z0: float = 100.0, limit: float = 10.0) -> bytes:
    """Return the data of a compressedDepth message of depth in mm (uint16) or m (float32)."""
    a = np.float32(z0 * (z0 + 1))
    b = np.float32(1 - a / limit)
    if depth.dtype.kind == "f":
        depth = np.array(
            [[int(a / d + b) if d < limit else 0 for d in row] for row in depth.tolist()], dtype=np.uint16
        )
    body = png(depth) if codec == "png" else struct.pack("<II", *depth.shape[::-1]) + rvl(depth.ravel().tolist())
    return struct.pack("<iff", 0, a, b) + body


def rvl(pixels: list[int]) -> bytes:
    """Return the RVL stream of pixels, as the paper describes it."""
    groups: list[int] = []

    def write(number: int) -> None:
        while number > 7:
            groups.append(8 + number % 8)
            number //= 8
        groups.append(number)

    at, last = 0, 0
    while at < len(pixels):
        begin = at
        while at < len(pixels) and pixels[at] == 0:
            at += 1
        write(at - begin)
        begin = at
        while at < len(pixels) and pixels[at] != 0:
            at += 1
        write(at - begin)
        for pixel in pixels[begin:at]:
            change = pixel - last
            write(2 * change if change >= 0 else -2 * change - 1)
            last = pixel
    digits = "".join(f"{group:x}" for group in groups)
    digits += "0" * (-len(digits) % 8)
    return b"".join(bytes.fromhex(digits[k : k + 8])[::-1] for k in range(0, len(digits), 8))


def _file(pixels: NDArray[Any], kind: str, **options: Any) -> bytes:
    file = BytesIO()
    Image.fromarray(pixels).save(file, kind, **options)
    return file.getvalue()
