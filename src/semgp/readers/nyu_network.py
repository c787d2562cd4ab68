"""What a segmentation network said about the frames of an NYU folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.conventions import ADE20K_32, ADE20K_32_TO_NYU13, NYU13
from semgp.errors import FileFormatError
from semgp.readers.grids import enlarge
from semgp.readers.npz import read_arrays


def network_probability_image(path: Path, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return the probability of each NYU13 class at each pixel, shape (H, W, 13).

    The file holds `p`: (h, w, 32) uint8, 255 times the probability of each ADE20K-32 class on a coarse grid.
    These are normalised, summed up to the NYU13 classes, and interpolated linearly. What a pixel's row lacks
    to one is the mass of the classes without a counterpart.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged or of another layout.
    """
    p = read_arrays(path, ("p",)).get("p")
    if p is None or p.dtype != np.uint8 or p.ndim != 3 or p.shape[2] != len(ADE20K_32) or min(p.shape) < 2:
        raise FileFormatError(path, f"must hold p, a (h, w, {len(ADE20K_32)}) array of uint8.")
    total = p.sum(axis=2, keepdims=True)
    if not total.all():
        raise FileFormatError(path, "has pixels where all probabilities are zero.")
    members = ADE20K_32_TO_NYU13[:, None] == np.arange(len(NYU13))
    coarse = (p / total) @ members
    return enlarge(coarse, shape, corners=True)  # as the network enlarges its own output
