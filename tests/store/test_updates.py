"""Stored maps that are updated: between queries, beside others, with clouds of every kind, back in time."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.executors import Threads
from semgp.store import MapStore, Settings, StoredMap, build
from tests.store.scenes import (
    CLASSES,
    FORGETTING,
    FREE,
    PLAIN,
    STREET,
    assert_same,
    cloud,
    in_memory,
    places,
    stored,
)


def test_updates_may_come_between_queries_and_commits(tmp_path: Path) -> None:
    made = StoredMap.create(tmp_path / "map", FREE, most_sites=400)
    for i, one in enumerate(STREET, 1):
        made.update(one)
        assert_same(made.query(places(i)), in_memory(FREE, *STREET[:i]).query(places(i)), 1e-5)
        if i == 3:
            assert made.commit("three") == 2
    assert made.commit() == 3
    assert made.commit("nothing new") == 3
    assert [MapStore(tmp_path / "map").manifest(n).note for n in (1, 2, 3)] == ["", "three", ""]


def test_dirty_tiles_are_written_when_there_is_no_room(tmp_path: Path) -> None:
    made = StoredMap.create(tmp_path / "map", PLAIN, most_sites=200)
    for one in STREET:
        made.update(one)
        assert made.info()["sites_in_memory"] <= 600
    assert len(list((tmp_path / "map" / "tiles").iterdir())) > 0
    assert MapStore(tmp_path / "map").manifest().sites == 0  # and nobody sees them yet
    assert_same(made.query(places(1)), in_memory(PLAIN, *STREET).query(places(1)), 1e-5)
    made.commit()
    listed = {t.name(k) for k, t in MapStore(tmp_path / "map").manifest().tiles.items()}
    MapStore(tmp_path / "map").tidy()
    assert {p.name for p in (tmp_path / "map" / "tiles").iterdir()} == listed


@pytest.mark.parametrize("settings", [PLAIN, FREE, FORGETTING])
def test_neighbours_of_what_others_have_changed_are_solved_anew(settings: Settings, tmp_path: Path) -> None:
    mine = stored(tmp_path / "map", *STREET[:3], settings=settings)
    before = mine.query(places(1))
    with StoredMap(tmp_path / "map") as other:
        other.update(cloud(9, 4.5, n=150))  # across a border
    np.testing.assert_array_equal(mine.query(places(1)).probability, before.probability)
    assert mine.refresh() == mine.version == 3
    fresh = StoredMap(tmp_path / "map").query(places(1))
    assert_same(mine.query(places(1)), fresh)
    assert_same(mine.query(places(1)), in_memory(settings, *STREET[:3], cloud(9, 4.5, n=150)).query(places(1)))
    assert (fresh.probability != before.probability).any()


def test_stray_points_without_a_label_do_no_harm(tmp_path: Path) -> None:
    first = STREET[0]
    stray = replace(
        first, points=np.vstack([first.points, [[1e7, 0, 0]]]), labels=np.append(first.hard_labels, -1)
    )
    made = stored(tmp_path / "map", STREET[1], stray)
    assert_same(made.query(places(1)), in_memory(PLAIN, STREET[1], stray).query(places(1)))


def test_clouds_without_points_or_labels_are_counted(tmp_path: Path) -> None:
    nothing = [STREET[0][:0], LabelledCloud(STREET[0].points, CLASSES), STREET[0]]
    by_update = stored(tmp_path / "map", *nothing)
    store = MapStore(tmp_path / "built")
    store.create(PLAIN)
    assert build(store, nothing, Threads(1)).clouds == by_update.clouds == 3
    assert store.manifest().tiles == by_update.store.manifest().tiles


def test_the_map_begins_where_its_first_point_that_counts_is(tmp_path: Path) -> None:
    points = np.vstack([[[900.0, 0, 0]], STREET[0].points])
    confidence = np.append(np.float32(0), np.ones(len(STREET[0]), np.float32))
    first = LabelledCloud(points, CLASSES, np.append(0, STREET[0].hard_labels), confidence=confidence)
    by_update = stored(tmp_path / "map", first)
    store = MapStore(tmp_path / "built")
    store.create(PLAIN)
    assert build(store, [first], Threads(1)).origin == by_update.store.manifest().origin
    assert store.manifest().tiles == by_update.store.manifest().tiles


def test_times_in_seconds_begin_anew_after_a_roll_back(tmp_path: Path) -> None:
    settings = replace(FORGETTING, forgetting=replace(FORGETTING.forgetting, per="second"))  # type: ignore[type-var]
    mine = stored(tmp_path / "map", replace(STREET[0], stamp=100.0), settings=settings)
    MapStore(tmp_path / "map").roll_back(1)
    mine.refresh()
    assert mine.origin is None
    mine.update(replace(STREET[0], stamp=5.0))
    wanted = in_memory(settings, replace(STREET[0], stamp=5.0))
    assert_same(mine.query(places(1)), wanted.query(places(1)))


def test_tiles_of_maps_that_forget_leave_memory_as_a_whole(tmp_path: Path) -> None:
    made = stored(tmp_path / "map", *STREET, settings=FORGETTING, most_sites=1)
    made.query(STREET[4].points)
    one = made.info()["bytes_in_memory"]
    made.query(STREET[0].points)
    made.query(STREET[4].points)
    assert made.info()["bytes_in_memory"] <= 1.01 * one


def test_a_map_that_forgets_goes_back_in_time(tmp_path: Path) -> None:
    made = stored(tmp_path / "map", *STREET[:2], settings=FORGETTING, most_sites=1)
    made.update(STREET[2])
    made.query(places(1))
    with pytest.raises(KeyError), made:
        raise KeyError
    assert_same(made.query(places(1)), in_memory(FORGETTING, *STREET[:2]).query(places(1)), 1e-5)
    made.update(STREET[3])
    wanted = in_memory(FORGETTING, *STREET[:2], STREET[3])
    assert_same(made.query(places(1)), wanted.query(places(1)), 1e-5)
