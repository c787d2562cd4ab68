"""A map that grows scan by scan, and the thread that shows it."""

import threading

import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import InputError, SemgpError
from semgp.maps.gp import GPSemanticMap
from semgp.viewer.playback import Playback
from semgp.viewer.worker import Latest, SupersededError
from tests.viewer.conftest import MODEL


def test_playback_goes_forth_and_back(corner: LabelledCloud) -> None:
    parts = [corner[i::3] for i in range(3)]
    playback = Playback(parts, lambda: GPSemanticMap(corner.classes, MODEL))
    playback.go_to(2)
    both = len(playback.semantic_map.positions)
    told: list[tuple[int, int]] = []
    playback.go_to(3, lambda n, total: told.append((n, total)))
    assert told == [(2, 3)]
    assert len(playback.semantic_map.positions) > both
    playback.go_to(2)
    assert len(playback.semantic_map.positions) == both
    with pytest.raises(InputError, match="1 to 3 scans, not 4"):
        playback.go_to(4)
    with pytest.raises(InputError, match="no scans"):
        Playback([], lambda: GPSemanticMap(corner.classes, MODEL))


def test_the_latest_request_wins() -> None:
    done: list[int] = []
    failures: list[str] = []
    begun, go = threading.Event(), threading.Event()

    def work(item: int) -> None:
        if item == 0:
            begun.set()
            go.wait(10)
            raise SupersededError
        if item == 3:
            raise InputError("three")
        done.append(item)
        begun.set()

    def failed(error: SemgpError) -> None:
        failures.append(str(error))
        begun.set()

    worker = Latest(work, failed)
    worker.start()
    for item in (0, 1, 2):
        worker.request(item)
        begun.wait(10)
    begun.clear()
    go.set()
    begun.wait(10)
    begun.clear()
    worker.request(3)
    begun.wait(10)
    worker.close()
    assert done == [2]
    assert failures == ["three"]
