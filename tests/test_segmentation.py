"""Segmentation networks: tiny ones against what they compute, and the real one against the files that it wrote."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.special import softmax

from semgp.class_files import ClassFile
from semgp.classes import Classes
from semgp.conventions import ADE20K_32, ADE20K_32_TO_NYU13, NYU13, labels_from_nyu, relabel
from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.readers import open_scans
from semgp.readers.label_folder import LabelFolder
from semgp.segmentation import MappedSegmenter, ModelCard, images_of, labelled_scans, open_segmenter
from semgp.segmentation.folder import segment_images, unlabelled
from semgp.segmentation.tflite import enlarged_by_corners, logits_of
from tests.networks import GAIN, QUARTERS, blocks_image, write_onnx
from tests.reader_samples import write_nyu_folder
from tests.rgbd_samples import write_seven_scenes, write_tum

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


def test_the_card_beside_the_model(tmp_path: Path) -> None:
    path = write_onnx(tmp_path / "net.onnx", outputs=("probabilities", "logits"))
    (tmp_path / "net.toml").write_text(
        'classes = ["r", "g", "b"]\nmean = [0.5, 0.5, 0.5]\nstd = [0.25, 0.25, 1]\nlogits = "logits"\n'
        'layout = "nchw"\nsize = [8, 8]\noutput = "logits"\n'
    )
    segmenter = open_segmenter(path)
    assert segmenter.classes.names == ("r", "g", "b")
    answer = segmenter.segment(blocks_image())
    expected = softmax(GAIN * (blocks_image() / 255 - 0.5) / [0.25, 0.25, 1], axis=2)
    assert answer.probability is not None
    np.testing.assert_allclose(answer.probability, expected, atol=1e-5)
    (tmp_path / "net.toml").write_text('classes = "list.csv"')
    (tmp_path / "list.csv").write_text("name\nred\ngreen\nblue\n")
    assert open_segmenter(path).classes == RGB


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("layout = 3", "layout is"),
        ('output = "labels"', "output is"),
        ("size = [8]", "size is two"),
        ("size = [8, 0]", "size is two"),
        ("mean = [1, 2]", "mean and std"),
        ("std = [1, 0, 1]", "mean and std"),
        ("logits = 3", "name of a tensor"),
        ("classe = 3", "no key 'classe'"),
        ('classes = "nothing"', "no class list"),
        ("= 3", "no model card"),
        ("a = " + "[" * 10_000, "no model card"),
    ],
)
def test_bad_cards(text: str, message: str, tmp_path: Path) -> None:
    path = write_onnx(tmp_path / "net.onnx")
    (tmp_path / "net.toml").write_text(text)
    with pytest.raises(FileFormatError, match=rf"net\.toml.*{message}"):
        open_segmenter(path)


def test_classes_that_nobody_names(tmp_path: Path) -> None:
    assert open_segmenter(write_onnx(tmp_path / "net.onnx")).classes == Classes.numbered(3)
    path = write_onnx(tmp_path / "net.onnx", outputs=("labels",))
    with pytest.raises(InputError, match=r"name them in a model card net\.toml"):
        open_segmenter(path)
    with pytest.raises(InputError, match="labels from 0 to 2, but 2 classes"):
        open_segmenter(path, Classes(("red", "green"))).segment(blocks_image())
    with pytest.raises(InputError, match="tells 3 classes apart, but 2 are named"):
        open_segmenter(write_onnx(tmp_path / "net.onnx"), Classes(("red", "green")))


def test_what_is_no_network_or_no_image(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"ends in \.tflite or \.onnx"):
        open_segmenter(tmp_path / "net.pt")
    with pytest.raises(InputError, match="no such file"):
        open_segmenter(tmp_path / "net.onnx")
    path = write_onnx(tmp_path / "net.onnx")
    for image in (np.zeros((8, 8), np.uint8), np.zeros((8, 8, 4), np.uint8), np.zeros((8, 8, 3))):
        with pytest.raises(InputError, match="an image is a"):
            open_segmenter(path).segment(image)  # type: ignore[arg-type]
    with pytest.raises(FileFormatError, match="has no output 'x', but logits"):
        open_segmenter(path, card=ModelCard(logits="x"))
    with pytest.raises(InputError, match="Say layout"):
        open_segmenter(write_onnx(tmp_path / "net.onnx", size=(3, 3)))
    segmenter = open_segmenter(write_onnx(tmp_path / "net.onnx"), card=ModelCard(output="probabilities"))
    with pytest.raises(InputError, match="are they logits"):
        segmenter.segment(np.zeros((8, 8, 3), np.uint8))


@pytest.mark.parametrize("ending", [".onnx", ".tflite"])
def test_damaged_files(ending: str, tmp_path: Path) -> None:
    whole = write_onnx(tmp_path / "net.onnx").read_bytes()
    path = tmp_path / f"bad{ending}"
    for content in (b"", b"TFL3", whole[:100], np.random.default_rng(0).bytes(1000)):
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match="or is damaged"):
            open_segmenter(path)


@pytest.mark.parametrize(
    ("ending", "module"), [(".onnx", "onnxruntime"), (".tflite", "ai_edge_litert.interpreter")]
)
def test_without_the_extra(ending: str, module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / f"net{ending}").write_bytes(b"")
    with pytest.raises(MissingExtraError, match=r"semgp\[segment\]"):
        open_segmenter(tmp_path / f"net{ending}")


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

    def testenlarged_by_corners_or_not(self) -> None:
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
