"""Labels as a segmentation network gives them: sparse, missing in patches, and wrong in patches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from semgp.classes import MISSING
from semgp.errors import InputError


@dataclass(frozen=True)
class LabelFaults:
    """What is wrong with the labels that the robot gets.

    Parameters
    ----------
    stride : int
        Labels are kept in every `stride`-th row and column only.
    wrong : float
        Share of the image, before thinning, that lies in blobs of wrong labels.
    missing : float
        Share of the image, before thinning, that lies in blobs without labels.
    blob : float
        Size of the blobs: standard deviation of the smoothing that makes them, in image widths.
    unlabelled : int
        Number of objects that no view labels; each is of a class that has other objects, such as a chair.

    Raises
    ------
    InputError
        Values outside their range.
    """

    stride: int = 3
    wrong: float = 0.08
    missing: float = 0.12
    blob: float = 0.025
    unlabelled: int = 1

    def __post_init__(self) -> None:
        if self.stride < 1 or self.unlabelled < 0:
            raise InputError("stride must be at least 1, and unlabelled must not be negative.")
        if not (0 <= self.wrong <= 1 and 0 <= self.missing <= 1 and self.blob > 0):
            raise InputError("wrong and missing are shares between 0 and 1, and blob must be above 0.")

    def apply(self, label: NDArray[np.int32], n_classes: int, rng: np.random.Generator) -> NDArray[np.int32]:
        """Return a faulty copy of a label image.

        Parameters
        ----------
        label : (height, width) array
            True labels.
        n_classes : int
            Number of classes, at least two.
        rng : numpy.random.Generator
            Source of the faults.
        """
        blob, n_blobs = ndimage.label(self._blobs(label.shape, self.wrong, rng))
        shift = np.append(0, rng.integers(1, n_classes, n_blobs))  # one confusion a blob, never with itself
        faulty = (label + shift[blob]) % n_classes
        faulty[self._blobs(label.shape, self.missing, rng)] = MISSING
        thinned = np.full(label.shape, MISSING, dtype=np.int32)
        grid = (slice(None, None, self.stride),) * 2
        thinned[grid] = faulty[grid]
        return thinned

    def _blobs(self, shape: tuple[int, ...], share: float, rng: np.random.Generator) -> NDArray[np.bool_]:
        """Return a mask of blobs that covers a share of the image: the highest part of smooth noise."""
        field = ndimage.gaussian_filter(rng.standard_normal(shape), self.blob * shape[1], mode="wrap")
        ranked = np.argsort(np.argsort(-field, axis=None)).reshape(shape)
        return np.asarray(ranked < share * field.size)
