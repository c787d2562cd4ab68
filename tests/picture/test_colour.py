"""Colours for labels and for numbers."""

import matplotlib as mpl
import numpy as np
import pytest

from semgp.classes import MISSING, Classes
from semgp.errors import InputError
from semgp.picture import (
    COLOUR_MAPS,
    GREY,
    by_class,
    by_value,
)
from tests.picture.samples import BLUE, RED


def test_class_colours_and_missing_grey() -> None:
    classes = Classes(("a", "b"), (RED, BLUE))
    labels = np.array([[0, 1], [MISSING, 0]])
    np.testing.assert_array_equal(by_class(labels, classes), [[RED, BLUE], [GREY, RED]])
    assert by_class(np.array([], dtype=int), classes).shape == (0, 3)
    for bad in ([2], [-2], [0.5]):
        with pytest.raises(InputError, match="labels"):
            by_class(bad, classes)


@pytest.mark.parametrize("name", COLOUR_MAPS)
def test_colour_maps_follow_their_originals_from_end_to_end(name: str) -> None:
    values = np.linspace(3, 5, 256)
    ours, original = by_value(values, colour_map=name), 255 * mpl.colormaps[name](np.linspace(0, 1, 256))
    np.testing.assert_array_equal(ours[[0, -1]], np.round(original[[0, -1], :3]))
    assert np.abs(ours.astype(int) - original[:, :3]).max() <= 7
    lightness = ours @ np.array([0.299, 0.587, 0.114])
    assert (np.diff(lightness) > -0.5).all()


def test_values_beyond_the_ends_share_the_end_colours_and_nan_is_grey() -> None:
    colours = by_value([-np.inf, -1.0, 0.0, 1.0, 9.0, np.nan], low=0, high=1)
    np.testing.assert_array_equal(colours[[0, 5]], [GREY, GREY])
    np.testing.assert_array_equal(colours[1], colours[2])
    np.testing.assert_array_equal(colours[3], colours[4])
    assert by_value([]).shape == (0, 3)
    assert (by_value([np.nan, np.nan]) == GREY).all()
    assert (by_value([2.0, 2.0]) == by_value([0.0, 1.0])[0]).all()
    with pytest.raises(InputError, match="jet"):
        by_value([1.0], colour_map="jet")
    with pytest.raises(InputError, match="low end"):
        by_value([1.0], low=2, high=1)
