"""Updates that are refused, forgotten or cannot be written leave the map as it was."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from semgp.classes import Classes
from semgp.errors import InputError
from semgp.store import Manifest, MapStore, Settings, StoredMap
from semgp.store.files import LocalFiles
from tests.store.scenes import (
    FORGETTING,
    FREE,
    PLAIN,
    STREET,
    assert_same,
    in_memory,
    places,
    stored,
)


def test_refreshing_needs_updates_to_be_committed(tmp_path: Path) -> None:
    mine = stored(tmp_path / "map", STREET[0])
    mine.update(STREET[1])
    with pytest.raises(InputError, match="commit them first"):
        mine.refresh()
    mine.commit()
    assert mine.refresh() == 3


def test_a_block_that_fails_leaves_no_trace(tmp_path: Path) -> None:
    mine = stored(tmp_path / "map", STREET[0], most_sites=100)
    wanted = mine.query(places(1))
    mine.update(STREET[1])
    mine.update(STREET[2])
    with pytest.raises(KeyError), mine:
        raise KeyError
    assert mine.commit() == 2
    assert mine.clouds == 1
    assert_same(mine.query(places(1)), wanted)
    with mine:
        mine.update(STREET[1])
    assert_same(StoredMap(tmp_path / "map").query(places(1)), in_memory(PLAIN, *STREET[:2]).query(places(1)))


@pytest.mark.parametrize("settings", [PLAIN, FREE, FORGETTING])
def test_a_refused_update_leaves_the_map_as_it_was(settings: Settings, tmp_path: Path) -> None:
    mine = stored(tmp_path / "map", *STREET[:2], settings=settings)
    mine.update(STREET[2])
    wanted = in_memory(settings, *STREET[:3])
    far = np.vstack([STREET[3].points, [[1e6, 0, 0]]])
    other = Classes(("floor", "wall", "sky"))
    bad = [
        replace(STREET[3], points=far, labels=np.append(STREET[3].hard_labels, 0)),
        replace(STREET[3], classes=other),
    ]
    bad += [replace(STREET[3], T_world_sensor=None)] if settings.free is not None else []
    for one in bad:
        with pytest.raises(InputError):
            mine.update(one)
    assert mine.clouds == 3
    assert_same(mine.query(places(1)), wanted.query(places(1)))
    mine.commit()
    assert_same(StoredMap(tmp_path / "map").query(places(1)), wanted.query(places(1)))


@pytest.mark.parametrize("most_sites", [1, 300])
def test_a_full_disk_loses_nothing_and_counts_nothing_twice(most_sites: int, tmp_path: Path) -> None:
    mine = stored(tmp_path / "map", STREET[0], most_sites=most_sites)
    create, taken = LocalFiles.create, []

    def full(files: LocalFiles, name: str, data: bytes) -> bool:
        if "tiles/" in name:
            raise InputError(f"cannot write {name}: No space left on device.")
        return create(files, name, data)

    with mock.patch.object(LocalFiles, "create", full):
        for one in STREET[1:4]:
            before = mine.clouds
            with suppress(InputError):
                mine.update(one)
            if mine.clouds > before:
                taken.append(one)
        with pytest.raises(InputError, match="No space left"):
            mine.commit()
    assert StoredMap(tmp_path / "map").clouds == 1
    assert taken
    mine.commit()
    made = StoredMap(tmp_path / "map")
    assert made.clouds == 1 + len(taken)
    assert_same(made.query(places(1)), in_memory(PLAIN, STREET[0], *taken).query(places(1)))


def test_the_first_update_may_be_refused(tmp_path: Path) -> None:
    made = StoredMap.create(tmp_path / "map", FREE)
    with pytest.raises(InputError):
        made.update(replace(STREET[0], T_world_sensor=None))
    assert made.store.drop([]) == 0  # it does not count as a writer
    made.update(STREET[1])
    assert_same(made.query(places(1)), in_memory(FREE, STREET[1]).query(places(1)))


def test_most_sites_must_be_positive(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="most_sites"):
        StoredMap.create(tmp_path / "map", PLAIN, most_sites=0)


@pytest.mark.parametrize("more", [False, True])
@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("beside", [False, True])
def test_a_version_whose_answer_was_lost_is_counted_once(
    there: bool, beside: bool, more: bool, tmp_path: Path
) -> None:
    mine = stored(tmp_path / "map", STREET[0])
    mine.update(STREET[1])
    add = MapStore.add

    def lost(store: MapStore, manifest: Manifest) -> None:
        if there:
            add(store, manifest)
        raise InputError("s3://maps: no answer within 16 s.")

    with mock.patch.object(MapStore, "add", lost), pytest.raises(InputError, match="no answer"):
        mine.commit()
    taken = [0, 1]
    if beside:
        with StoredMap(tmp_path / "map") as other:
            other.update(STREET[2])
        taken.append(2)
    if more:
        mine.update(STREET[3])
        taken.append(3)
    mine.commit()
    mine.refresh()
    made = StoredMap(tmp_path / "map")
    assert made.clouds == mine.clouds == len(taken)
    wanted = in_memory(PLAIN, *(STREET[i] for i in taken))
    assert_same(made.query(places(1)), wanted.query(places(1)))
    assert_same(mine.query(places(1)), wanted.query(places(1)))
