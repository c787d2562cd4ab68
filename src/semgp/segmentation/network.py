"""From an image to a network's input, and from its output to a segmentation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.readers.grids import enlarged_argmax
from semgp.segmentation.card import ModelCard
from semgp.segmentation.protocol import Answer, Network, Segmentation


@dataclass(frozen=True)
class NetworkSegmenter:
    """A segmenter around a network of any file type.

    The image is resized to the network's input, bilinearly and without keeping its proportions. Labels are those
    that the network decides for, brought to the image's size by nearest neighbour; or, where it puts out scores
    only, the class of highest score of each pixel after linear interpolation.

    Parameters
    ----------
    network : Network
        The network.
    classes : Classes
        What it tells apart.
    card : ModelCard
        What its file does not say.

    Raises
    ------
    InputError
        An input that is no colour image, or another size of it or number of classes than the network's.
    """

    network: Network
    classes: Classes
    card: ModelCard = ModelCard()  # noqa: RUF009 (frozen)

    def __post_init__(self) -> None:
        self._input_size()
        n = n_classes(self.network, self.card)
        if n is not None and n != len(self.classes):
            raise InputError(
                f"the network tells {n} classes apart, but {len(self.classes)} are named: name them all."
            )

    def segment(self, image: NDArray[np.uint8]) -> Segmentation:
        """Return what a colour image (H, W, 3) shows.

        Raises
        ------
        InputError
            What is no colour image; labels or scores of the network that do not fit the classes.
        """
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or not image.size:
            raise InputError(f"an image is a (H, W, 3) array of uint8, not {image.shape} of {image.dtype}.")
        answer = self.network.run(self._input(image))
        scores = self._scores(answer)
        shape = (image.shape[0], image.shape[1])
        if answer.labels is not None:
            labels = self._labels(answer.labels, shape)
        else:
            assert scores is not None
            labels = enlarged_argmax(scores, shape, corners=answer.corners)
        probability = None if scores is None else self._probability(scores, answer.tolerance)
        return Segmentation(labels, probability, answer.corners)

    def _input_size(self) -> tuple[int | None, ...]:
        """Return rows and columns of the input; None where it takes any."""
        shape = self.network.input_shape
        own = shape[1:3] if has_channels_last(self.network, self.card) else shape[2:4]
        size = self.card.size or own
        if any(fixed not in (None, wanted) for fixed, wanted in zip(own, size)):
            raise InputError(f"the network takes images of {own} pixels, not of {size} as its model card says.")
        return size

    def _input(self, image: NDArray[np.uint8]) -> NDArray[Any]:
        """Return an image as the batch of one that the network takes."""
        from PIL import Image

        rows, columns = self._input_size()
        size = (columns or image.shape[1], rows or image.shape[0])
        pixels = np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BILINEAR))
        kind = self.network.input_type
        if kind.kind == "f":
            mean, std = np.array(self.card.mean), np.array(self.card.std)
            pixels = ((pixels / 255 - mean) / std).astype(kind)
        elif kind == np.int8:
            pixels = (pixels.astype(np.int16) - 128).astype(np.int8)
        elif kind != np.uint8:
            raise InputError(f"an input of {kind} is not known: the network must take uint8, int8 or floats.")
        batch = pixels[None] if has_channels_last(self.network, self.card) else pixels.transpose(2, 0, 1)[None]
        return np.ascontiguousarray(batch)

    def _labels(self, labels: NDArray[np.integer[Any]], shape: tuple[int, int]) -> NDArray[np.int32]:
        from PIL import Image

        if labels.min() < 0 or labels.max() >= len(self.classes):
            raise InputError(
                f"the network says labels from {labels.min()} to {labels.max()}, but {len(self.classes)} classes "
                "are named: name them all."
            )
        image = Image.fromarray(labels.astype(np.int32)).resize(shape[::-1], Image.Resampling.NEAREST)
        return np.array(image, dtype=np.int32)

    def _scores(self, answer: Answer) -> NDArray[np.float32] | None:
        """Return the scores (h, w, C) with their channels last."""
        if answer.scores is None:
            return None
        scores = answer.scores if has_channels_last(self.network, self.card) else np.moveaxis(answer.scores, 0, -1)
        if scores.ndim != 3 or scores.shape[2] != len(self.classes) or not np.isfinite(scores).all():
            raise InputError(
                f"scores of shape {scores.shape} are none of {len(self.classes)} classes: name them all, and "
                "say the layout in a model card."
            )
        return scores

    def _probability(self, scores: NDArray[np.float32], tolerance: float) -> NDArray[np.float32]:
        """Return scores as probabilities; logits are told by their sums."""
        total = scores.sum(axis=2, keepdims=True)
        sums_to_one = scores.min() >= 0 and np.abs(total - 1).max() <= tolerance
        if self.card.output == "probabilities" and not (scores.min() >= 0 and total.min() > 0):
            raise InputError("the network's probabilities are negative or all zero: are they logits?")
        if self.card.output == "probabilities" or (self.card.output is None and sums_to_one):
            return np.asarray(scores / total)
        return np.asarray(softmax(scores, axis=2))


def has_channels_last(network: Network, card: ModelCard) -> bool:
    """Tell whether a network's images are (rows, columns, channels).

    Raises
    ------
    InputError
        An input that is no colour image, or might be either way.
    """
    shape = network.input_shape
    if len(shape) != 4 or shape[0] not in (None, 1):
        raise InputError(f"an input of shape {shape} is no image: it must have four axes, the first of size 1.")
    if card.layout is None and (shape[3] == 3) == (shape[1] == 3):
        raise InputError(
            f"which axis of the input {shape} is colour? Say layout = 'nhwc' or 'nchw' in a model card."
        )
    return shape[3] == 3 if card.layout is None else card.layout == "nhwc"


def n_classes(network: Network, card: ModelCard) -> int | None:
    """Return how many classes a network tells apart; None where its file does not say."""
    last, shape = has_channels_last(network, card), network.scores_shape
    return None if shape is None or len(shape) != 4 else shape[3 if last else 1]
