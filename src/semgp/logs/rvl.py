"""RVL, the lossless compression of depth images that image_transport's compressedDepth offers beside PNG.

Source: A. D. Wilson, "Fast lossless depth image compression", ISS 2017. Numbers follow each other: how many pixels
are 0, how many then are not, for each of these by how much it differs from the last one that was not 0, and again.
A number is written in groups of three bits, the lowest first, each behind a bit that says whether more follow; a
difference d as 2 d, or as -2 d - 1 where it is negative. Eight such groups of four bits make a 32-bit word, the
first group at the top; words are little-endian.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semgp.errors import InputError

_LONGEST = 11
"""Groups of the longest number of 32 bits."""


def unpacked(data: bytes, n: int) -> NDArray[np.uint16]:
    """Return the pixels (n,) of an RVL stream.

    Raises
    ------
    InputError
        A stream that ends early, or runs on past the last pixel.
    """
    numbers = _numbers(data)
    places, changes = [], []
    done = at = 0
    while done < n:
        zeros, others = numbers[at : at + 2].tolist() if at + 2 <= len(numbers) else (0, 0)
        first, done = done + zeros, done + zeros + others
        at += 2 + others
        if done > n or at > len(numbers) or not zeros + others:
            raise InputError("its RVL stream is damaged or truncated.")
        places.append(slice(first, done))
        changes.append(numbers[at - others : at])
    pixels = np.zeros(n, dtype=np.uint16)
    coded = np.concatenate(changes) if changes else numbers[:0]
    values = np.cumsum((coded >> 1) ^ -(coded & 1)).astype(np.uint16)
    at = 0
    for place in places:
        length = place.stop - place.start
        pixels[place] = values[at : at + length]
        at += length
    return pixels


def _numbers(data: bytes) -> NDArray[np.int64]:
    """Return all numbers of a stream; groups at its end that complete none are dropped."""
    if len(data) % 4:
        raise InputError("its RVL stream is damaged or truncated.")
    words = np.frombuffer(data, dtype="<u4").astype(">u4").view(np.uint8)
    groups = np.stack([words >> 4, words & 15], axis=1).ravel()
    ends = np.flatnonzero(groups < 8)
    if not len(ends):
        return np.empty(0, dtype=np.int64)
    starts = np.concatenate([[0], ends[:-1] + 1])
    lengths = ends + 1 - starts
    if lengths.max() > _LONGEST:
        raise InputError("its RVL stream is damaged or truncated.")
    shifts = 3 * (np.arange(ends[-1] + 1) - np.repeat(starts, lengths))
    return np.add.reduceat((groups[: ends[-1] + 1] & 7).astype(np.int64) << shifts, starts)
