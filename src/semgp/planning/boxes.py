"""Grids of cells in a box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.checks import as_array
from semgp.errors import InputError

MOST_CELLS = 1 << 24
"""A box of more cells than these 16,777,216 is refused: asking for so many takes minutes."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Cubes side by side that cover a box of D dimensions from its low corner on; the last may stand out of it.

    Parameters
    ----------
    low : (D,) array
        The corner in metres.
    resolution : float
        Edge of a cell in metres.
    shape : tuple of int
        Cells along each axis.
    """

    low: NDArray[np.float64]
    resolution: float
    shape: tuple[int, ...]

    def __len__(self) -> int:
        return int(np.prod(self.shape))

    def centres(self, flat: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres (n, D) of cells, numbered with the last axis running fastest."""
        index = np.stack(np.unravel_index(flat, self.shape), axis=1)
        return np.asarray(self.low + (index + 0.5) * self.resolution)


def box_corners(low: ArrayLike, high: ArrayLike, n_dims: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of a box.

    Raises
    ------
    InputError
        Corners that are not so many finite numbers each, or not in order.
    """
    a, b = as_array("low", low, np.float64), as_array("high", high, np.float64)
    if a.shape != (n_dims,) or b.shape != (n_dims,) or not np.isfinite([a, b]).all() or not (a < b).all():
        raise InputError(
            f"a box needs two corners of {n_dims} finite numbers, low below high along each axis, not "
            f"{a.tolist()} and {b.tolist()}."
        )
    return a, b


def cells_between(low: NDArray[np.float64], high: NDArray[np.float64], resolution: float) -> Cells:
    """Return the cells of a box.

    Raises
    ------
    InputError
        More than `MOST_CELLS`.
    """
    with np.errstate(over="ignore"):  # infinitely many are too many
        shape = np.maximum(np.ceil((high - low) / resolution - 1e-9), 1)  # 0.3 / 0.1 may be a little more than 3
        require_few(float(np.prod(shape)), resolution)
    return Cells(low, resolution, tuple(int(n) for n in shape))


def require_few(n_cells: float, resolution: float) -> None:
    """Check that there are not too many cells.

    Raises
    ------
    InputError
        More than `MOST_CELLS`.
    """
    if n_cells > MOST_CELLS:
        raise InputError(
            f"the box has {n_cells:,.0f} cells of {resolution:g} m, more than {MOST_CELLS:,}: take a smaller "
            "box, or a coarser resolution."
        )
