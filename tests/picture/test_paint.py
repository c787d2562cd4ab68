"""What a map's answers look like."""

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.picture import GREY
from semgp.picture.paint import Bar, paint, paint_labels
from semgp.prediction import Prediction
from tests.conftest import THREE


def answer() -> Prediction:
    p = np.array([[0.8, 0.1, 0.1], [0.2, 0.5, 0.3], [1 / 3, 1 / 3, 1 / 3]])
    return Prediction(
        THREE, p, np.array([True, True, False]), variance=np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9.0]])
    )


class TestPaint:
    def test_classes_that_occur_are_the_key(self) -> None:
        shown = paint(answer(), "class")
        np.testing.assert_array_equal(shown.colours, [*THREE.palette[:2], GREY])
        assert shown.key == Classes(THREE.names[:2], THREE.colours[:2])
        assert shown.missing == "not observed"
        assert paint_labels("x", np.array([0]), THREE, "none").missing is None
        assert paint_labels("x", np.array([-1]), THREE, "none").key is None

    @pytest.mark.parametrize(
        ("by", "high"), [("confidence", 1.0), ("entropy", 1.1), ("variance", 5.0), ("wall", 1.0)]
    )
    def test_values_have_a_bar_and_are_grey_where_nothing_is_observed(self, by: str, high: float) -> None:
        shown = paint(answer(), by)
        assert isinstance(shown.key, Bar)
        assert shown.key.low == 0.0
        assert shown.key.high == pytest.approx(high, abs=0.05)
        assert (shown.colours[2] == GREY).all()
        assert (shown.colours[:2] != GREY).any(axis=1).all()

    def test_brighter_is_more(self) -> None:
        for by, more in (("confidence", 0), ("entropy", 1), ("variance", 1), ("floor", 0), ("wall", 1)):
            light = paint(answer(), by).colours[:2].astype(int) @ (0.299, 0.587, 0.114)
            assert light.argmax() == more

    def test_names_that_say_nothing(self) -> None:
        with pytest.raises(
            InputError, match="choose from class, confidence, entropy, variance, floor, wall, table"
        ):
            paint(answer(), "sofa")
        with pytest.raises(InputError, match="no variance"):
            paint(Prediction(THREE, answer().probability, answer().observed), "variance")
