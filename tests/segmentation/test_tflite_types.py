"""TFLite networks of each type of input: floats, and both ways to quantise."""

from pathlib import Path

import numpy as np
import pytest
from scipy.special import softmax

from semgp.classes import Classes
from semgp.segmentation import ModelCard, open_segmenter
from tests.tflite_networks import GAIN, Kind, write_tflite

RGB = Classes(("red", "green", "blue"))


@pytest.fixture
def image() -> np.ndarray:
    """Return an image whose brightest channel leads by 10 of 255, more than a step of any quantisation."""
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 246, (8, 8, 3)).astype(np.uint8)
    np.put_along_axis(pixels, pixels.argmax(axis=2)[..., None], pixels.max(axis=2, keepdims=True) + 10, axis=2)
    return pixels


@pytest.mark.parametrize("kind", ["float32", "int8", "uint8"])
@pytest.mark.parametrize("labels", [False, True])
def test_what_it_says_is_what_the_pixels_say(kind: Kind, labels: bool, image: np.ndarray, tmp_path: Path) -> None:
    network = write_tflite(tmp_path / "net.tflite", kind, labels=labels)
    answer = open_segmenter(network, RGB).segment(image)
    np.testing.assert_array_equal(answer.label, image.argmax(axis=2))
    assert answer.probability is not None
    expected = softmax(GAIN * image / 255, axis=2)
    np.testing.assert_allclose(answer.probability, expected, atol=1e-5 if kind == "float32" else 0.02)


def test_a_float_input_is_normalised_as_its_card_says(image: np.ndarray, tmp_path: Path) -> None:
    network = write_tflite(tmp_path / "net.tflite", "float32")
    card = ModelCard(mean=(0.5, 0.4, 0.3), std=(0.2, 0.25, 0.5))
    answer = open_segmenter(network, RGB, card).segment(image)
    assert answer.probability is not None
    expected = softmax(GAIN * (image / 255 - [0.5, 0.4, 0.3]) / [0.2, 0.25, 0.5], axis=2)
    np.testing.assert_allclose(answer.probability, expected, atol=1e-5)
