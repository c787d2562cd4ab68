"""How pages are put together: grids, legends, colour bars."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.picture import (
    DARK,
    GREY,
    WHITE,
    by_value,
    colour_bar,
    legend,
    panels,
    stack,
)
from semgp.picture.compose import _ticks


def contains(page: NDArray[np.uint8], colour: tuple[int, int, int]) -> bool:
    """Return whether a picture has a patch of a colour, not just a pixel of blended letters."""
    return int((page == colour).all(axis=2).sum()) > 50


def test_a_grid_holds_its_pictures_unchanged() -> None:
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 256, (30, 40, 3), dtype=np.uint8) for _ in range(5)]
    page = panels(images, columns=3, font_size=10)
    assert page.shape == (2 * 30 + 3 * 10, 3 * 40 + 4 * 10, 3)
    np.testing.assert_array_equal(page[10:40, 10:50], images[0])
    np.testing.assert_array_equal(page[50:80, 60:100], images[4])
    assert (page[50:80, 110:150] == 255).all()  # the empty cell
    assert panels(images).shape[1] > panels(images, columns=1).shape[1]


def test_titles_are_written_above_the_pictures_in_readable_ink() -> None:
    image = np.full((30, 120, 3), 128, dtype=np.uint8)
    for background, darkest in ((WHITE, True), (DARK, False)):
        page = panels([image, image], ["truth", ""], background=background)
        head = page[: len(page) - 30 - 24].astype(int)
        left, right = head[:, : head.shape[1] // 2], head[:, head.shape[1] // 2 :]
        assert (left.min() < 60) if darkest else (left.max() > 200)
        assert (right == background).all()
    with pytest.raises(InputError, match="titles"):
        panels([image, image], ["one"])
    with pytest.raises(InputError, match="at least one picture"):
        panels([])
    with pytest.raises(InputError, match="column"):
        panels([image], columns=0)
    with pytest.raises(InputError, match="uint8"):
        panels([image.astype(float)])


def test_a_stack_centres_its_pictures() -> None:
    wide, narrow = np.zeros((10, 50, 3), dtype=np.uint8), np.full((20, 30, 3), 9, dtype=np.uint8)
    page = stack([wide, narrow])
    assert page.shape == (30, 50, 3)
    assert (page[10:, 10:40] == 9).all()
    assert (page[10:, :10] == 255).all()
    with pytest.raises(InputError, match="at least one"):
        stack([])


def test_a_legend_shows_every_class_and_fits_its_width() -> None:
    classes = Classes.numbered(9)
    tall, wide = legend(classes), legend(classes, width=700)
    assert wide.shape[1] == 700
    assert len(tall) > 2.5 * len(wide)
    assert tall.shape[1] < 700
    for page in (tall, wide):
        assert all(contains(page, colour) for colour in classes.colours)
        assert not contains(page, GREY)
    with_missing = legend(classes, missing="no label")
    assert contains(with_missing, GREY)
    assert len(with_missing) > len(tall)
    assert legend(classes, width=10).shape[1] == tall.shape[1]  # never narrower than one column
    assert len(legend(classes, font_size=12)) < len(tall)


def test_a_colour_bar_runs_from_end_to_end() -> None:
    page = colour_bar(0, 2, "entropy (nats)", width=300, font_size=20)
    assert page.shape[1] == 300
    ends = by_value([0.0, 2.0])
    bar = page[46]  # through the middle of the bar
    np.testing.assert_array_equal(bar[[40, 259]], ends)
    assert (bar[:40] == 255).all()
    assert (bar[260:] == 255).all()
    assert len(colour_bar(0, 2, width=300, font_size=20)) < len(page)
    for low, high in ((1, 1), (2, 1), (0, np.inf)):
        with pytest.raises(InputError, match="ends"):
            colour_bar(low, high)
    with pytest.raises(InputError, match="width"):
        colour_bar(0, 1, width=50)


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.integers(2, 12))
def test_ticks_are_few_round_numbers_between_the_ends(low: float, span: float, most: int) -> None:
    high = low + span
    ticks = _ticks(low, high, most)
    slack = 1e-6 * max(abs(low), abs(high), span)
    assert len(ticks) <= most + 1
    assert all(low - slack <= t <= high + slack for t in ticks)
    if len(ticks) > 1:
        np.testing.assert_allclose(np.diff(ticks), ticks[1] - ticks[0], rtol=1e-5, atol=slack)


def test_known_ticks() -> None:
    assert _ticks(0, 1, 5) == [0, 0.2, 0.4, 0.6, 0.8, 1]
    assert _ticks(0.03, 1.49, 3) == [0.5, 1.0]
    assert _ticks(-20, 100, 4) == [0, 50, 100]
