"""Scans and folders of images, segmented."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from semgp.classes import Classes
from semgp.errors import FileFormatError, InputError
from semgp.readers import open_scans
from semgp.readers.label_folder import LabelFolder
from semgp.segmentation import images_of, labelled_scans, open_segmenter
from semgp.segmentation.folder import segment_images, unlabelled
from tests.networks import blocks_image, write_onnx
from tests.reader_samples import write_nyu_folder
from tests.rgbd_samples import write_seven_scenes, write_tum

RGB = Classes(("red", "green", "blue"))


class TestScans:
    @pytest.mark.parametrize("write", [write_seven_scenes, write_tum, write_nyu_folder])
    def test_as_from_a_label_folder(self, write: Any, tmp_path: Path) -> None:
        path = write(tmp_path)
        segmenter = open_segmenter(write_onnx(tmp_path / "net.onnx", stride=2), RGB)
        scans = labelled_scans(path, open_scans(path), segmenter)
        images = images_of(path)
        assert len(images) == len(scans)
        assert unlabelled(images, tmp_path / "out") == list(images)
        assert [image for image, _ in segment_images(images, segmenter, tmp_path / "out")] == list(images)
        assert unlabelled(images, tmp_path / "out") == []
        folder = LabelFolder(tmp_path / "out")
        from_folder = open_scans(path, labels=tmp_path / "out")
        for i, cloud in enumerate(scans):
            assert cloud.classes == RGB
            assert cloud.pixels is not None
            assert cloud.image_shape is not None
            assert cloud.weights is not None
            _, soft = folder.at_pixels(images[i].stem, cloud.pixels, cloud.image_shape)
            assert soft is not None
            np.testing.assert_allclose(cloud.weights, soft, atol=0.51 / 255)
            np.testing.assert_array_equal(from_folder[i].weights, soft)
            hard, _ = folder.at_pixels(images[i].stem, cloud.pixels, cloud.image_shape, soft=False)
            scan = labelled_scans(path, open_scans(path), segmenter, soft=False)[i]
            np.testing.assert_array_equal(scan.labels, hard)

    def test_scans_without_images(self, tmp_path: Path) -> None:
        segmenter = open_segmenter(write_onnx(tmp_path / "net.onnx"), RGB)
        path = write_seven_scenes(tmp_path)
        with pytest.raises(InputError, match="give an RGB-D folder"):
            labelled_scans(path / "x.ply", open_scans(path), segmenter)


class TestImages:
    def test_what_a_path_means(self, tmp_path: Path) -> None:
        for name in ("b.jpg", "a.PNG", "c.txt", "sub.png"):
            (tmp_path / name).write_text("")
        assert [p.name for p in images_of(tmp_path)] == ["a.PNG", "b.jpg", "sub.png"]
        assert [p.name for p in images_of(tmp_path / "*.jpg")] == ["b.jpg"]
        assert images_of(tmp_path / "b.jpg") == (tmp_path / "b.jpg",)
        for nothing in ("*.gif", "z.jpg"):
            with pytest.raises(InputError, match="no such file or folder"):
                images_of(tmp_path / nothing)

    def test_a_folder_without_images(self, tmp_path: Path) -> None:
        with pytest.raises(FileFormatError, match=r"has no \.png or \.jpg"):
            images_of(tmp_path)

    def test_two_of_one_name(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="2 images are called a"):
            unlabelled([tmp_path / "x/a.png", tmp_path / "y/a.jpg"], tmp_path)

    def test_images_are_not_overwritten(self, tmp_path: Path) -> None:
        Image.fromarray(blocks_image()).save(tmp_path / "a.png")
        segmenter = open_segmenter(write_onnx(tmp_path / "net.onnx"), RGB)
        with pytest.raises(InputError, match="holds the images"):
            unlabelled([tmp_path / "a.png"], tmp_path)
        with pytest.raises(InputError, match="holds the images"):
            list(segment_images([tmp_path / "a.png"], segmenter, tmp_path))
        assert not (tmp_path / "classes.toml").exists()
        with Image.open(tmp_path / "a.png") as image:
            assert image.mode == "RGB"
