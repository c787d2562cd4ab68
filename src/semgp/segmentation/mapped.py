"""A segmenter in the classes of a map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semgp.class_files import ClassFile
from semgp.classes import Classes
from semgp.conventions import relabel
from semgp.errors import InputError
from semgp.remapping import remapping_table
from semgp.segmentation.protocol import Segmentation, Segmenter


class MappedSegmenter:
    """A segmenter whose answers are turned into other classes.

    Labels without a counterpart become missing; probabilities are added up, and what a row lacks to one is the
    mass of the classes without a counterpart.

    Parameters
    ----------
    segmenter : Segmenter
        The network.
    mapping : ClassFile
        The classes that are wanted, with what each takes in; see `semgp.remapping.remapping_table`.

    Raises
    ------
    InputError
        A mapping that knows none of the network's classes, or names some where the network's have no names.
    """

    def __init__(self, segmenter: Segmenter, mapping: ClassFile) -> None:
        if segmenter.classes.nameless and mapping.members:
            raise InputError(
                "the mapping goes by names, but the network's classes have none: say which list they are, "
                "or write it into a model card (see semgp.segmentation.card)."
            )
        self.segmenter, self.classes = segmenter, Classes(mapping.classes.names, mapping.classes.colours)
        self._table = remapping_table(segmenter.classes, mapping)

    def segment(self, image: NDArray[np.uint8]) -> Segmentation:
        """Return what a colour image (H, W, 3) shows; see `Segmenter`."""
        answer = self.segmenter.segment(image)
        members = (self._table[:, None] == np.arange(len(self.classes))).astype(np.float32)
        probability = None if answer.probability is None else np.minimum(answer.probability @ members, 1)
        return Segmentation(relabel(answer.label, self._table), probability, answer.corners)
