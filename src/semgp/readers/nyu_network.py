"""What a segmentation network said about the frames of an NYU folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgp.conventions import ADE20K_32, ADE20K_32_TO_NYU13, NYU13
from semgp.errors import FileFormatError
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
    down, across = _linear(shape[0], p.shape[0]), _linear(shape[1], p.shape[1])
    fine = np.einsum("ri,ijc,sj->rsc", down, coarse, across, optimize=True)
    return np.asarray(fine, dtype=np.float32)


def _linear(n_fine: int, n_coarse: int) -> NDArray[np.float64]:
    """Return the weights (n_fine, n_coarse) of linear interpolation between coarse samples.

    Coarse sample i lies at fine position i n_fine / n_coarse: the network enlarges its own output so (the
    other custom, by pixel centres, disagrees with its full-size labels at three times as many pixels).
    """
    at = np.minimum(np.arange(n_fine) * n_coarse / n_fine, n_coarse - 1)
    below = np.minimum(at.astype(int), n_coarse - 2)
    weights = np.zeros((n_fine, n_coarse))
    weights[np.arange(n_fine), below] = 1 - (at - below)
    weights[np.arange(n_fine), below + 1] = at - below
    return weights
