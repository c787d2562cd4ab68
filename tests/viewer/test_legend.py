"""The classes in the live viewer's panel."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.maps.gp import GPSemanticMap
from semgp.viewer import cards
from semgp.viewer.live import LiveViewer
from semgp.viewer.playback import Playback
from semgp.viewer.sample import Sample
from tests.viewer.conftest import MODEL

pytest.importorskip("viser", reason="the live viewer needs the extra view")

FIVE = Classes(("roof", "floor", "wall", "table", "lamp"))


@pytest.fixture
def playing(corner: LabelledCloud) -> Iterator[LiveViewer]:
    """The floor and half the wall, then all of the wall and the table; neither roof nor lamp."""
    label = np.where(corner.hard_labels == MISSING, MISSING, corner.hard_labels + 1)
    cloud = LabelledCloud(corner.points, FIVE, label)
    first = (label == 1) | (label == 2) & (corner.points[:, 2] < 0.6)
    with LiveViewer(Playback([cloud[first], cloud[~first]], lambda: GPSemanticMap(FIVE, MODEL)), port=0) as live:
        assert live.wait(60)
        yield live


def listed(viewer: LiveViewer) -> list[tuple[str, bool]]:
    """Return the names that are shown, in order, and whether they are on."""
    boxes: list[Any] = [box for box, _ in viewer._controls.legend._rows.values() if box.visible]
    return [(box.label, box.value) for box in sorted(boxes, key=lambda box: box.order)]


def test_what_occurs_is_listed_most_points_first(playing: LiveViewer) -> None:
    assert playing.shown is not None
    shares = playing.shown.sample.shares()
    assert [(name, True) for name in named(shares)] == listed(playing)
    assert "roof" not in named(shares)
    seen = [share for label, share in shares if label != MISSING]
    assert seen == sorted(seen, reverse=True)
    for label, share in shares:
        assert share == pytest.approx(np.mean(playing.shown.sample.prediction.label == label))
        assert cards.percent(share) in playing._controls.legend._rows[label][1].content


def test_the_list_follows_the_map_and_keeps_what_is_off(playing: LiveViewer) -> None:
    assert "table" not in dict(listed(playing))
    playing._controls.legend._rows[1][0].value = False
    playing.switch(1, on=False)
    playing.change(scans=2)
    assert playing.wait(60)
    after = dict(listed(playing))
    assert after["table"]
    assert not after["floor"]
    assert playing.shown is not None
    assert not (playing.shown.sample.prediction.label[playing.shown.rows] == 1).any()
    playing.change(scans=1)
    assert playing.wait(60)
    assert "table" not in dict(listed(playing))
    assert not dict(listed(playing))["floor"]


def test_classes_that_come_while_all_are_off_are_off(playing: LiveViewer) -> None:
    buttons: Any = playing._controls.legend._buttons
    buttons.value = "none"
    playing._controls.legend._all_or_none()
    playing.change(scans=2)
    assert playing.wait(60)
    assert playing.shown is not None
    assert not len(playing.shown.rows)
    assert not any(on for _, on in listed(playing))


def test_what_is_not_observed_comes_last(sample: Sample) -> None:
    labels = [label for label, _ in sample.shares()]
    assert MISSING not in labels[:-1]
    assert sum(share for _, share in sample.shares()) == pytest.approx(1)


def test_shares_in_words() -> None:
    words = {1.0: "100 %", 0.372: "37 %", 0.0951: "9.5 %", 0.0004: "&lt; 0.1 %", 0.0: "0.0 %"}
    assert {share: cards.percent(share) for share in words} == words
    assert [cards.length(metres) for metres in (0.0115, 0.25, 1.2)] == ["1.1 cm", "25 cm", "1.20 m"]


def named(shares: list[tuple[int, float]]) -> list[str]:
    return ["not observed" if label == MISSING else FIVE.names[label] for label, _ in shares]
