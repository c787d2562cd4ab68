"""Marc Lehmann's LZF compression, in which PCL packs the bodies of PCD files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from semgp.errors import FileFormatError

LARGEST_RATIO = 264 / 3
"""Three bytes stand for 264 at most."""


def unpacked(path: Path, packed: bytes, size: int) -> NDArray[np.uint8]:
    """Return the `size` bytes that were packed.

    Raises
    ------
    FileFormatError
        Bytes that unpack to another size, or not at all; nothing is allocated for a size that they cannot have.
    """
    if size > LARGEST_RATIO * len(packed):
        raise FileFormatError(path, f"is damaged: {len(packed)} bytes cannot unpack to {size}.")
    found = np.empty(size, dtype=np.uint8)
    if _unpack(np.frombuffer(packed, dtype=np.uint8), found) != size:
        raise FileFormatError(path, f"is truncated or damaged: it does not unpack to the {size} bytes declared.")
    return found


@njit(cache=True, nogil=True)
def _unpack(packed: NDArray[np.uint8], found: NDArray[np.uint8]) -> int:
    """Fill in the bytes; return how many there are, -1 for what cannot be."""
    at, end = 0, 0
    while at < len(packed):
        control = int(packed[at])
        at += 1
        if control < 32:  # so many bytes and one as they are
            length = control + 1
            if at + length > len(packed) or end + length > len(found):
                return -1
            found[end : end + length] = packed[at : at + length]
            at += length
            end += length
            continue
        length = (control >> 5) + 2  # a copy of so many bytes from further back
        if length == 9:
            if at >= len(packed):
                return -1
            length += int(packed[at])
            at += 1
        if at >= len(packed):
            return -1
        start = end - ((control & 31) << 8) - int(packed[at]) - 1
        at += 1
        if start < 0 or end + length > len(found):
            return -1
        for i in range(length):  # byte by byte: the copy may run into itself
            found[end + i] = found[start + i]
        end += length
    return end
