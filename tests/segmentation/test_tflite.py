"""TFLite networks: which tensor holds the logits, and the real one against the files that it wrote."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semgp.class_files import ClassFile
from semgp.conventions import ADE20K_32, ADE20K_32_TO_NYU13, NYU13, labels_from_nyu, relabel
from semgp.errors import FileFormatError
from semgp.segmentation import MappedSegmenter, ModelCard, images_of, open_segmenter
from semgp.segmentation.tflite import enlarged_by_corners, logits_of


class TestTFLiteTensors:
    """Which tensor holds the logits, from the details that the interpreter gives."""

    @staticmethod
    def tensor(index: int, *shape: int, scale: float = 0.1, name: str = "") -> dict[str, Any]:
        return {"index": index, "name": name, "shape": np.array(shape), "quantization": (scale, 0)}

    def test_the_one_before_the_argmax_or_what_it_enlarges(self) -> None:
        small, large = self.tensor(4, 1, 8, 8, 5, name="add"), self.tensor(6, 1, 32, 32, 5)
        labels, other = self.tensor(7, 1, 32, 32), self.tensor(3, 1, 8, 8, 5, scale=0.2)
        path = Path("net.tflite")
        assert logits_of(path, [other, small, large, labels], 7, None) == (small, large)
        assert logits_of(path, [other, large, labels], 7, None) == (large, None)
        assert logits_of(path, [other, small, large, labels], 7, "add") == (small, large)
        assert logits_of(path, [self.tensor(1, 5), labels], 7, None) == (None, None)
        assert logits_of(path, [labels], 7, None) == (None, None)
        with pytest.raises(FileFormatError, match="has no tensor 'sum'"):
            logits_of(path, [small, labels], 7, "sum")

    def test_enlarged_by_corners_or_not(self) -> None:
        small = np.random.default_rng(0).random((4, 4, 2)).astype(np.float32)
        assert enlarged_by_corners(small, np.kron(small, np.ones((3, 3, 1))))
        assert not enlarged_by_corners(small, np.random.default_rng(1).random((12, 12, 2)))
        assert not enlarged_by_corners(small, np.random.default_rng(1).random((13, 10, 2)))


class TestRealNetwork:
    """The MOSAIC network against the files that it wrote."""

    @staticmethod
    def files_of(image: Path) -> tuple[np.ndarray[Any, Any], ...]:
        """Return an image, the labels in both lists, and the probabilities."""
        with np.load(image.with_name(f"{image.name[:4]}_mosaic_prob128.npz")) as file:
            probability = file["p"] / 255
        endings = ("rgb.jpg", "mosaic_ade32.png", "mosaic_nyu13.png")
        return *(np.array(Image.open(image.with_name(f"{image.name[:4]}_{e}"))) for e in endings), probability

    def test_all_frames(self, data_dir: Path) -> None:
        segmenter = open_segmenter(data_dir / "models" / "mosaic_r4_ade32.tflite", ADE20K_32)
        images = images_of(data_dir / "nyu")
        assert len(images) == 12
        for image in images:
            colour, ade32, nyu13, probability = self.files_of(image)
            answer = segmenter.segment(colour)
            assert (answer.label == ade32).mean() > 0.97
            assert (relabel(answer.label, ADE20K_32_TO_NYU13) == labels_from_nyu(nyu13, NYU13)).mean() > 0.97
            assert answer.probability is not None
            assert np.abs(answer.probability - probability).mean() < 0.005
            assert answer.corners

    def test_in_the_maps_classes_with_the_tensor_named(self, data_dir: Path) -> None:
        path = data_dir / "models" / "mosaic_r4_ade32.tflite"
        named = open_segmenter(path, ADE20K_32, ModelCard(logits="decoder/add"))
        colour, _, nyu13, probability = self.files_of(data_dir / "nyu" / "0282_rgb.jpg")
        answer = MappedSegmenter(named, nyu13_mapping()).segment(colour)
        assert (answer.label == labels_from_nyu(nyu13, NYU13)).mean() > 0.97
        assert answer.probability is not None
        wall = probability[..., [ADE20K_32.index(name) for name in ("wall", "door", "building", "house")]].sum(
            axis=2
        )
        assert np.abs(answer.probability[..., NYU13.index("wall")] - wall).mean() < 0.005

    def test_a_tensor_that_is_not_there(self, data_dir: Path) -> None:
        path = data_dir / "models" / "mosaic_r4_ade32.tflite"
        with pytest.raises(FileFormatError, match="has no tensor 'nothing'"):
            open_segmenter(path, card=ModelCard(logits="nothing"))


def nyu13_mapping() -> ClassFile:
    """Return the table from the network's classes to NYU's as a class file says it."""
    names = np.array(ADE20K_32.names)
    return ClassFile(NYU13, tuple(tuple(names[c == ADE20K_32_TO_NYU13].tolist()) for c in range(len(NYU13))))
