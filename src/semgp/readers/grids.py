"""Class probabilities on a coarse grid over an image, and their values at its pixels.

Networks answer on a coarse grid, and there are two customs of where its cells lie. By pixel centres, n coarse
cells share N pixels evenly: cell i is centred on pixel (i + 1/2) N / n - 1/2. By corners, cell i lies on pixel
i N / n: so older networks enlarge their own output, and reading it by centres would move every border between
classes by (N / n - 1) / 2 pixels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Grid = NDArray[np.floating[Any]]


def sample(
    grid: Grid, pixels: NDArray[np.integer[Any]], shape: tuple[int, int], *, corners: bool = False
) -> NDArray[np.float32]:
    """Return the values (N, C) of a grid (h, w, C) at pixels (N, 2) of an image, interpolated linearly.

    Parameters
    ----------
    grid : (h, w, C) float array
        Values on the coarse grid.
    pixels : (N, 2) integer array
        Row and column of each pixel.
    shape : (int, int)
        Rows and columns of the image.
    corners : bool
        The custom of the grid, see the module.
    """
    grid = grid.astype(np.float32, copy=False)
    (top, bottom, down), (left, right, across) = (
        _neighbours(pixels[:, axis], shape[axis], grid.shape[axis], corners) for axis in (0, 1)
    )
    upper = grid[top, left] * (1 - across) + grid[top, right] * across
    lower = grid[bottom, left] * (1 - across) + grid[bottom, right] * across
    return np.asarray(upper * (1 - down) + lower * down, dtype=np.float32)


def enlarge(grid: Grid, shape: tuple[int, int], *, corners: bool = False) -> NDArray[np.float32]:
    """Return the values (H, W, C) of a grid (h, w, C) at all pixels of an image of a shape (H, W).

    See Also
    --------
    sample : the same at some pixels.
    """
    top, bottom, down = _neighbours(np.arange(shape[0]), shape[0], grid.shape[0], corners)
    wide, down = _widened(grid, shape[1], corners), down[:, None]
    return np.asarray(wide[top] * (1 - down) + wide[bottom] * down, dtype=np.float32)


def enlarged_argmax(grid: Grid, shape: tuple[int, int], *, corners: bool = False) -> NDArray[np.int32]:
    """Return the column of the largest value at each pixel, shape (H, W), enlarging one row at a time."""
    wide = _widened(grid, shape[1], corners)
    labels = np.empty(shape, dtype=np.int32)
    for row, (top, bottom, down) in enumerate(
        zip(*_neighbours(np.arange(shape[0]), shape[0], len(grid), corners))
    ):
        labels[row] = (wide[top] * (1 - down) + wide[bottom] * down).argmax(axis=1)
    return labels


def _widened(grid: Grid, width: int, corners: bool) -> NDArray[np.float32]:
    """Return a grid enlarged along its rows, shape (h, width, C)."""
    grid = grid.astype(np.float32, copy=False)
    left, right, across = _neighbours(np.arange(width), width, grid.shape[1], corners)
    return np.asarray(grid[:, left] * (1 - across) + grid[:, right] * across)


def _neighbours(
    fine: NDArray[np.integer[Any]], n_fine: int, n_coarse: int, corners: bool
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]:
    """Return the coarse cells before and after each fine position, and the weight (N, 1) of the one after."""
    at = fine * n_coarse / n_fine if corners else (fine + 0.5) * n_coarse / n_fine - 0.5
    at = np.clip(at, 0, n_coarse - 1)
    before = at.astype(np.intp)
    return before, np.minimum(before + 1, n_coarse - 1), (at - before).astype(np.float32)[:, None]
