"""Diagrams of one set of scores."""

import io
import sys

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from semgp.classes import Classes
from semgp.errors import InputError, MissingExtraError
from semgp.evaluation.calibration import reliability
from semgp.evaluation.diagrams import confusion_diagram, reliability_diagram
from semgp.evaluation.figures import Figure
from semgp.evaluation.metrics import confusion

CLASSES = Classes(("floor", "wall", "table", "sofa"))


def opened(figure: Figure) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(figure.png)).convert("RGB"))


def dark_blue(picture: NDArray[np.uint8]) -> int:
    """Pixels of the colour of the whole of a row."""
    near = np.abs(picture.astype(int) - (8, 48, 107)).max(axis=2) < 8
    return int(near.sum())


def test_confusion_grows_with_what_was_given_and_is_dark_where_labels_are_right() -> None:
    truth = np.repeat([0, 1], 50)
    right = opened(confusion_diagram(confusion(truth, truth, 4), CLASSES))
    mixed = confusion(np.tile([0, 1, 3, -1], 25), truth, 4)
    wrong = opened(confusion_diagram(mixed, CLASSES))
    assert wrong.shape[0] == right.shape[0]  # the truth has two classes, too
    assert wrong.shape[1] > right.shape[1]  # but sofa and "not observed" were given
    assert dark_blue(right) > 1000
    assert dark_blue(wrong) == 0


def test_reliability_is_a_picture() -> None:
    p = np.random.default_rng(0).dirichlet(np.ones(3), 400)
    picture = opened(reliability_diagram(reliability(p, p.argmax(axis=1))))
    assert picture.shape[0] == picture.shape[1]
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 20


def test_what_a_confusion_diagram_refuses() -> None:
    for table in (np.zeros((4, 5), dtype=np.int64), np.ones((4, 4), dtype=np.int64)):
        with pytest.raises(InputError, match=r"shape \(4, 5\)"):
            confusion_diagram(table, CLASSES)


def test_diagrams_need_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingExtraError, match=r"semgp\[figures\]"):
        confusion_diagram(confusion([0, 1], [0, 1], 4), CLASSES)
