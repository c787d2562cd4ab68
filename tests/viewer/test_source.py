"""What a live viewer asks, and when."""

from dataclasses import replace

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.maps.gp import GPSemanticMap
from semgp.viewer.playback import Playback
from semgp.viewer.source import Source, Tell
from semgp.viewer.state import ViewState
from tests.viewer.conftest import MODEL


def silent(text: str, share: float) -> None:
    assert text
    assert 0 <= share <= 1


def test_a_map_is_asked_anew_only_for_points_or_scans(gp_map: GPSemanticMap) -> None:
    source = Source(gp_map, 10_000)
    state = source.first_state(None, "class", ["wall"], [])
    assert state.hidden == {1}
    first = source.sample(state, silent)
    assert first.resolution == pytest.approx(source.surface.spacing / 2)
    assert source.sample(state.switched(0, on=False), silent) is first
    assert Source(gp_map, 100).first_state(None, "class", [], []).resolution == source.surface.spacing
    with pytest.raises(InputError, match="at least one point"):
        Source(gp_map, 0)


def test_scans_that_were_added_before_it_gave_up_are_not_lost(corner: LabelledCloud) -> None:
    source = Source(
        Playback([corner[i::4] for i in range(4)], lambda: GPSemanticMap(corner.classes, MODEL)), 10_000
    )
    with pytest.raises(InterruptedError):
        source.sample(state_of(source, 4), giving_up(after=2))
    assert source.scans == 3
    source.sample(state_of(source, 3), silent)
    whole = GPSemanticMap(corner.classes, MODEL)
    for i in range(3):
        whole.update(corner[i::4])
    np.testing.assert_array_equal(source.surface.positions, whole.positions)


def state_of(source: Source, scans: int) -> ViewState:
    return replace(source.first_state(0.3, "class", [], []), scans=scans)


def giving_up(after: int) -> Tell:
    told: list[str] = []

    def tell(text: str, _: float) -> None:
        told.append(text)
        if len(told) > after:
            raise InterruptedError

    return tell
