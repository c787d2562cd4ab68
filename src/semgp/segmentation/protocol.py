"""What a segmenter is, and what it says about an image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from semgp.classes import Classes


@dataclass(frozen=True, eq=False)
class Segmentation:
    """What a network says about an image of H x W pixels.

    Parameters
    ----------
    label : (H, W) int32 array
        Label of each pixel, `MISSING` where the classes have none for it.
    probability : (h, w, C) float32 array, optional
        Class probabilities on a grid over the image, as the network gives them; None where it gives labels only.
        A row sums to one, or to less where classes of the network have no counterpart.
    corners : bool
        The custom of the grid, see `semgp.readers.grids`.
    """

    label: NDArray[np.int32]
    probability: NDArray[np.float32] | None = None
    corners: bool = False


class Segmenter(Protocol):
    """A network that says what an image shows."""

    @property
    def classes(self) -> Classes:
        """The classes that it tells apart."""
        ...

    def segment(self, image: NDArray[np.uint8]) -> Segmentation:
        """Return what a colour image (H, W, 3) shows.

        Raises
        ------
        InputError
            What is no colour image.
        """
        ...


@dataclass(frozen=True)
class Answer:
    """What a network puts out for one image, in its own pixels.

    Parameters
    ----------
    labels : (h, w) integer array, optional
        The classes it decided for.
    scores : (h, w, C) or (C, h, w) float32 array, optional
        Logits or probabilities; at least one of the two is there. Channels are where the input has its own.
    tolerance : float
        What probabilities may lack to a sum of one: the rounding of quantised outputs.
    corners : bool
        The custom of the grid of scores.
    """

    labels: NDArray[np.integer[Any]] | None = None
    scores: NDArray[np.float32] | None = None
    tolerance: float = 1e-3
    corners: bool = False


class Network(Protocol):
    """A network opened by the library of its file type."""

    @property
    def input_shape(self) -> tuple[int | None, ...]:
        """The four sizes of the input; None where any will do."""
        ...

    @property
    def input_type(self) -> np.dtype[Any]:
        """Type of the input."""
        ...

    @property
    def scores_shape(self) -> tuple[int | None, ...] | None:
        """Sizes of the scores of a batch; None where it puts out labels only."""
        ...

    def run(self, batch: NDArray[Any]) -> Answer:
        """Return the answer to a batch of one image."""
        ...
