"""Clouds, queries, arrays and settings that the rival maps refuse."""

from __future__ import annotations

import numpy as np
import pytest

from semgp.baselines.bki import BKIMap
from semgp.baselines.csm import CSMMap
from semgp.baselines.knn import KNNMap
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from tests.baselines.rivals import CLASSES, C, Maker, every_rival, filled, random_cloud


@every_rival
def test_other_classes_and_bad_queries_are_refused(make: Maker) -> None:
    rival = filled(make, random_cloud(10))
    with pytest.raises(InputError, match="classes"):
        rival.update(LabelledCloud(np.zeros((1, 3)), Classes(("a",)), labels=np.zeros(1, np.int32)))
    for bad in (np.zeros((2, 2)), np.full((1, 3), np.nan)):
        with pytest.raises(InputError, match="query points"):
            rival.query(bad)


@every_rival
def test_damaged_arrays_are_refused(make: Maker) -> None:
    rival = filled(make, random_cloud(14))
    header, arrays = rival.to_arrays()
    for name, a in arrays.items():
        without = {k: v for k, v in arrays.items() if k != name}
        bad = [without, arrays | {name: a.astype(np.complex128)}, arrays | {name: a[..., None]}]
        bad += [arrays | {name: a[:-1]}] if name != "votes" else [arrays | {name: a[:1]}]
        bad += [arrays | {name: a - a.dtype.type(2)}] if name in ("mass", "votes", "vote_of") else []
        bad += [arrays | {name: np.full_like(a, 7)}] if name == "keys" else []
        bad += [arrays | {name: np.full_like(a, np.nan)}] if name == "points" else []
        for damaged in bad:
            with pytest.raises(InputError):
                type(rival).from_arrays(CLASSES, header, damaged)
    for name in header:
        with pytest.raises(InputError, match=name):
            type(rival).from_arrays(CLASSES, {k: v for k, v in header.items() if k != name}, arrays)
    with pytest.raises(InputError):
        type(rival).from_arrays(Classes.numbered(C + 1), header, arrays)


@pytest.mark.parametrize(
    "build",
    [
        lambda: KNNMap(CLASSES, k=0),
        lambda: KNNMap(CLASSES, k=1.5),  # type: ignore[arg-type]
        lambda: KNNMap(CLASSES, width=0),
        lambda: KNNMap(CLASSES, kernel="box"),  # type: ignore[arg-type]
        lambda: KNNMap(CLASSES, max_distance=-1),
        lambda: KNNMap(CLASSES, alpha0=-1),
        lambda: CSMMap(CLASSES, resolution=0),
        lambda: CSMMap(CLASSES, resolution="wide"),  # type: ignore[arg-type]
        lambda: CSMMap(CLASSES, alpha0=float("nan")),
        lambda: BKIMap(CLASSES, ell=-0.3),
        lambda: BKIMap(CLASSES, resolution=0.01, ell=1.0),
        lambda: BKIMap(CLASSES, sigma0=float("inf")),
        lambda: BKIMap(CLASSES, alpha0=0),
    ],
)
def test_settings_that_make_no_sense_are_refused(build: Maker) -> None:
    with pytest.raises(InputError):
        build()


def test_a_failed_first_update_leaves_the_map_as_it_was() -> None:
    stray = LabelledCloud(np.array([[0, 0, 0], [1e6, 0, 0]]), CLASSES, labels=np.array([0, 1], np.int32))
    good = LabelledCloud(np.array([[2e6, 0, 0]]), CLASSES, labels=np.array([2], np.int32))
    for rival in (CSMMap(CLASSES, 0.02), BKIMap(CLASSES, 0.02, 0.1)):
        with pytest.raises(InputError, match="stray points"):
            rival.update(stray)
        assert len(rival) == 0
        rival.update(good)
        assert rival.query(good.points).label.tolist() == [2]
