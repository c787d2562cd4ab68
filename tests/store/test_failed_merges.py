"""Merges that fail leave the updates as they are, to be merged again."""

from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from semgp.errors import ConflictError, InputError
from semgp.store import Manifest, MapStore, StoredMap
from semgp.store.bucket import BucketFiles
from tests.store.scenes import PLAIN, assert_same, cloud, crowd, places


def test_a_base_that_is_gone_from_a_bucket_cannot_be_merged(tmp_path: Path) -> None:
    memory = pytest.importorskip("obstore.store", reason="buckets need the extra cloud").MemoryStore()
    store = MapStore("mem://drive", BucketFiles(memory, "mem://drive"))
    assert not store.sees_writers
    with StoredMap.create(store, PLAIN) as made:
        made.update(cloud(0, 1.0))
    slow = StoredMap(store)
    slow.update(cloud(1, 1.0))
    with StoredMap(store) as fast:
        fast.update(cloud(2, 1.0))
    assert store.drop([1, 2]) is not None  # against what is asked of the caller
    for _ in range(2):
        with pytest.raises(ConflictError, match="version 2 has been removed"):
            slow.commit()
    assert slow.clouds == 2
    assert store.numbers() == [3]
    assert list(store.check()) == []


def test_a_merge_that_fails_half_way_adds_nothing_twice(crowded: MapStore) -> None:
    mine = StoredMap(crowded)
    mine.update(cloud(9, 1.0))
    add, others = MapStore.add, [10, 11]

    def contested(store: MapStore, manifest: Manifest) -> None:
        if others and manifest.clouds > 4:
            with StoredMap(crowded.location) as other, mock.patch.object(MapStore, "add", add):
                other.update(cloud(others.pop(0), 1.0))
                other.commit()
            if not others:  # the second merge fails
                raise_next.append(True)
        add(store, manifest)

    put, raise_next = MapStore.put, list[bool]()

    def full(store: MapStore, *arguments: Any) -> Any:
        if raise_next:
            raise_next.clear()
            raise InputError("no space left on device.")
        return put(store, *arguments)

    with (
        mock.patch.object(MapStore, "add", contested),
        mock.patch.object(MapStore, "put", full),
        pytest.raises(InputError, match="no space"),
    ):
        mine.commit()
    assert mine.commit() == 8
    assert mine.clouds == 7
    assert_same(mine.query(places(1)), crowd(0, 1, 2, 3, 9, 10, 11))
    assert_same(StoredMap(crowded).query(places(1)), crowd(0, 1, 2, 3, 9, 10, 11))
