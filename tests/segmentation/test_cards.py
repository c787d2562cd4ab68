"""Model cards, class names, and files that are no network."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.special import softmax

from semgp.classes import Classes
from semgp.errors import FileFormatError, InputError, MissingExtraError
from semgp.segmentation import ModelCard, open_segmenter
from tests.networks import GAIN, blocks_image, write_onnx

RGB = Classes(("red", "green", "blue"))


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
