"""Scans that teach nothing, and settings that make no sense."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.reliability.confusion import Confusion, learn_confusion
from semgp.reliability.ranges import RangeConfidence, learn_range_confidence
from tests.reliability.annotators import CONFUSION, FOUR, FREQUENCIES, RESOLUTION, random_scans

F64 = NDArray[np.float64]

TWO = random_scans(1, n=2)
LEARN = (learn_confusion, learn_range_confidence)


@pytest.mark.parametrize("learn", LEARN)
@pytest.mark.parametrize(
    ("scans", "message"),
    [
        ([], "0 of 0 scans"),
        (TWO[:1], "1 of 1 scans have labels"),
        ([TWO[0], replace(TWO[1], labels=None)], "1 of 2 scans have labels"),
        ([TWO[0], replace(TWO[1], confidence=np.zeros(60, np.float32))], "1 of 2 scans have labels"),
        ([TWO[0], replace(TWO[1], points=TWO[1].points + 50)], "no voxel of 0.25 m"),
        ([TWO[0], replace(TWO[1], points=TWO[1].points + 5e6)], "more than"),
        ([TWO[0], replace(TWO[1], classes=Classes.numbered(4))], "classes differ"),
        ([replace(c, classes=Classes(("all",)), labels=np.zeros(60, int)) for c in TWO], "one class, all"),
    ],
)
def test_scans_that_teach_nothing(learn: Callable[..., object], scans: list[LabelledCloud], message: str) -> None:
    with pytest.raises(InputError, match=message):
        learn(scans, resolution=RESOLUTION)


@pytest.mark.parametrize("learn", LEARN)
@pytest.mark.parametrize("resolution", [0.0, -1.0, np.nan, np.inf])
def test_bad_resolution(learn: Callable[..., object], resolution: float) -> None:
    with pytest.raises(InputError, match="resolution must be a positive number"):
        learn(TWO, resolution=resolution)


def test_ranges_need_poses() -> None:
    blind = [replace(c, T_world_sensor=None) for c in TWO]
    with pytest.raises(InputError, match="T_world_sensor"):
        learn_range_confidence(blind, resolution=RESOLUTION)
    with pytest.raises(InputError, match="T_world_sensor"):
        RangeConfidence(1.0).apply(blind[0])
    learn_confusion(blind, resolution=RESOLUTION)  # which needs none


@pytest.mark.parametrize(
    "settings",
    [{"iterations": 0}, {"prior": 0.0}, {"prior": np.nan}, {"prior": np.inf}],
)
def test_bad_settings(settings: dict[str, float]) -> None:
    with pytest.raises(InputError, match="iterations must be"):
        learn_confusion(TWO, resolution=RESOLUTION, **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "law",
    [(0.0, 2.0, 0.0), (np.nan, 2.0, 0.0), (1.0, -1.0, 0.0), (1.0, np.inf, 0.0), (1.0, 2.0, 1.5), (1, 1, np.nan)],
)
def test_bad_law(law: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="must"):
        RangeConfidence(*law)


@pytest.mark.parametrize(
    ("classes", "matrix", "frequencies", "message"),
    [
        (FOUR, np.eye(3), FREQUENCIES, "matrix"),
        (FOUR, np.eye(4) * 2, FREQUENCIES, "matrix"),
        (FOUR, np.eye(4) * np.nan, FREQUENCIES, "matrix"),
        (FOUR, np.eye(4) * 2 - 1 / 4, FREQUENCIES, "matrix"),
        (FOUR, CONFUSION, FREQUENCIES[:3], "frequencies"),
        (FOUR, CONFUSION, FREQUENCIES * 2, "frequencies"),
        (Classes(("all",)), np.eye(1), np.ones(1), "two classes"),
    ],
)
def test_bad_confusion(classes: Classes, matrix: F64, frequencies: F64, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Confusion(classes, matrix, frequencies)


def test_confusion_of_other_classes() -> None:
    confusion = Confusion(Classes.numbered(4), CONFUSION, FREQUENCIES)
    for method in (confusion.apply, confusion.weigh):
        with pytest.raises(InputError, match="road"):
            method(TWO[0])
