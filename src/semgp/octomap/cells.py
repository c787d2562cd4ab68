"""What an OctoMap answers: cells of space, and occupancy at points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgp.octomap.sensor import probability


@dataclass(frozen=True, eq=False)
class Cells:
    """L cubes of space, each known or unknown as a whole.

    Parameters
    ----------
    centres : (L, 3) array
        Their centres in metres, world frame.
    sizes : (L,) array
        Their edges in metres.
    log_odds : (L,) float32 array
        Log-odds of being occupied; 0 where unknown.
    """

    centres: NDArray[np.float64]
    sizes: NDArray[np.float64]
    log_odds: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.sizes)

    def __getitem__(self, keep: NDArray[np.bool_]) -> Cells:
        """Return the cells that a mask selects."""
        return Cells(self.centres[keep], self.sizes[keep], self.log_odds[keep])

    @property
    def probability(self) -> NDArray[np.float64]:
        """Probability (L,) of being occupied."""
        return probability(self.log_odds)


@dataclass(frozen=True, eq=False)
class Occupancy:
    """What is known of the space at M points.

    Parameters
    ----------
    log_odds : (M,) float32 array
        Log-odds of being occupied; 0 where unknown.
    known : (M,) bool array
        True where some ray passed or ended.
    occupied : (M,) bool array
        True where known to be occupied.
    """

    log_odds: NDArray[np.float32]
    known: NDArray[np.bool_]
    occupied: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.log_odds)

    @property
    def free(self) -> NDArray[np.bool_]:
        """True (M,) where known to be free."""
        return np.asarray(self.known & ~self.occupied)

    @property
    def probability(self) -> NDArray[np.float64]:
        """Probability (M,) of being occupied; one half where unknown."""
        return probability(self.log_odds)
