"""Segmentation networks of every layout, against what they compute."""

from pathlib import Path

import numpy as np
import pytest
from scipy.special import softmax

from semgp.class_files import ClassFile
from semgp.classes import Classes
from semgp.errors import InputError
from semgp.segmentation import MappedSegmenter, ModelCard, open_segmenter
from tests.networks import GAIN, QUARTERS, blocks_image, write_onnx

onnx = pytest.importorskip("onnx", reason="tiny networks are made with onnx")
RGB = Classes(("red", "green", "blue"))


@pytest.mark.parametrize("nhwc", [False, True])
@pytest.mark.parametrize(
    "outputs", [("logits",), ("probabilities",), ("labels",), ("labels4",), ("labels", "logits")], ids="-".join
)
def test_every_layout_and_output_gives_the_same_answer(
    outputs: tuple[str, ...], nhwc: bool, tmp_path: Path
) -> None:
    segmenter = open_segmenter(write_onnx(tmp_path / "net.onnx", nhwc=nhwc, outputs=outputs), RGB)
    answer = segmenter.segment(blocks_image())
    assert segmenter.classes == RGB
    np.testing.assert_array_equal(answer.label, QUARTERS)
    if outputs[-1].startswith("labels"):
        assert answer.probability is None
    else:
        assert answer.probability is not None
        expected = softmax(GAIN * blocks_image() / 255, axis=2)
        np.testing.assert_allclose(answer.probability, expected, atol=1e-5)


def test_labels_of_larger_images(tmp_path: Path) -> None:
    expected = np.kron(QUARTERS, np.ones((4, 4)))
    by_labels = open_segmenter(write_onnx(tmp_path / "net.onnx", outputs=("labels",)), RGB)
    np.testing.assert_array_equal(by_labels.segment(blocks_image(32)).label, expected)
    by_scores = open_segmenter(write_onnx(tmp_path / "net.onnx"), RGB)
    differs = by_scores.segment(blocks_image(32)).label != expected
    assert not np.delete(np.delete(differs, (15, 16), 0), (15, 16), 1).any()  # there colours are mixed


def test_coarse_scores_are_interpolated(tmp_path: Path) -> None:
    segmenter = open_segmenter(write_onnx(tmp_path / "net.onnx", stride=2), RGB)
    answer = segmenter.segment(blocks_image())
    assert answer.probability is not None
    assert answer.probability.shape == (4, 4, 3)
    np.testing.assert_array_equal(answer.label, QUARTERS)


def test_open_sizes_take_the_image_as_it_is_or_the_cards_size(tmp_path: Path) -> None:
    path = write_onnx(tmp_path / "net.onnx", size=("h", "w"))
    free = open_segmenter(path, RGB).segment(blocks_image(24)).probability
    fixed = open_segmenter(path, RGB, ModelCard(size=(8, 16))).segment(blocks_image(24)).probability
    assert free is not None
    assert fixed is not None
    assert (free.shape, fixed.shape) == ((24, 24, 3), (8, 16, 3))


def test_sizes_that_the_network_does_not_take(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"images of \(8, 8\) pixels, not of \(8, 16\)"):
        open_segmenter(write_onnx(tmp_path / "net.onnx"), RGB, ModelCard(size=(8, 16)))
    with pytest.raises(InputError, match="the first of size 1"):
        open_segmenter(write_onnx(tmp_path / "net.onnx", batch=2), RGB)
    with pytest.raises(InputError, match="does not take a batch of shape"):
        open_segmenter(write_onnx(tmp_path / "net.onnx", size=("h", "w"), gate=5), RGB).segment(blocks_image())


def test_integer_inputs(tmp_path: Path) -> None:
    for kind in (onnx.TensorProto.UINT8, onnx.TensorProto.INT8):
        segmenter = open_segmenter(write_onnx(tmp_path / "net.onnx", kind=kind), RGB)
        np.testing.assert_array_equal(segmenter.segment(blocks_image()).label, QUARTERS)
    with pytest.raises(InputError, match="must take uint8, int8 or floats"):
        open_segmenter(write_onnx(tmp_path / "net.onnx", kind=onnx.TensorProto.INT32), RGB).segment(blocks_image())


class TestMapped:
    MAPPING = ClassFile(Classes(("warm", "cold")), (("red",), ("blue",)))

    def test_labels_and_probabilities(self, tmp_path: Path) -> None:
        segmenter = open_segmenter(write_onnx(tmp_path / "net.onnx"), RGB)
        own, mapped = (s.segment(blocks_image()) for s in (segmenter, MappedSegmenter(segmenter, self.MAPPING)))
        np.testing.assert_array_equal(mapped.label, np.array([0, -1, 1])[own.label])
        assert own.probability is not None
        assert mapped.probability is not None
        np.testing.assert_allclose(mapped.probability, own.probability[..., [0, 2]], atol=1e-7)

    def test_names_need_names(self, tmp_path: Path) -> None:
        segmenter = open_segmenter(write_onnx(tmp_path / "net.onnx"))
        with pytest.raises(InputError, match="say which list they are"):
            MappedSegmenter(segmenter, self.MAPPING)
        numbers = ClassFile(Classes(("warm", "cold"), ids=((0,), (1, 2))))
        answer = MappedSegmenter(segmenter, numbers).segment(blocks_image())
        np.testing.assert_array_equal(answer.label, np.minimum(QUARTERS, 1))
