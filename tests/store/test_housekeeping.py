"""Keeping house: versions that are pruned, and files of no version that are removed."""

from pathlib import Path

import pytest

from semgp.errors import FileFormatError, InputError
from semgp.store import MapStore, StoredMap
from tests.store.scenes import (
    assert_same,
    cloud,
    places,
)


def tile_names(store: MapStore) -> set[str]:
    return {path.name for path in (Path(store.location) / "tiles").iterdir()}


def listed(store: MapStore) -> set[str]:
    return {tile.name(key) for n in store.numbers() for key, tile in store.manifest(n).tiles.items()}


def test_pruning_keeps_the_newest_and_their_files(five: MapStore) -> None:
    before = StoredMap(five).query(places(1))
    gone = tile_names(five)
    assert five.prune(2) == len(gone - tile_names(five)) > 0
    assert five.numbers() == [4, 5]
    assert tile_names(five) == listed(five)
    assert_same(StoredMap(five).query(places(1)), before)
    with pytest.raises(InputError, match="no version 3, but 4 to 5"):
        five.roll_back(3)
    assert five.prune(7) == 0
    assert five.prune(1) > 0
    assert five.numbers() == [5]
    with StoredMap(five) as mine:
        mine.update(cloud(9))
    assert five.numbers() == [5, 6]
    for keep in (0, -1):
        with pytest.raises(InputError, match="at least one"):
            five.prune(keep)


def test_pruning_waits_for_writers(five: MapStore) -> None:
    writer = StoredMap(five)  # of the same store object, too
    writer.update(cloud(9))
    for store in (five, MapStore(five.location)):
        with pytest.raises(InputError, match="another writer is at work"):
            store.prune(1)
    assert five.numbers() == [1, 2, 3, 4, 5]
    writer.commit()
    assert MapStore(five.location).prune(1) > 0
    assert five.prune(1) == 0


def test_what_no_version_lists_is_removed_by_the_next_writer(five: MapStore) -> None:
    folder = Path(five.location) / "tiles"
    orphan = f"{0:016x}-{'0' * 32}.npz"
    (folder / orphan).write_bytes(b"left by a writer that died")
    (folder / ".partial-0123456789abcdef").write_bytes(b"half")
    (folder / "README.md").write_text("somebody's own")
    (folder / "old").mkdir()
    with StoredMap(five) as writer:
        writer.update(cloud(9))
        assert not {orphan, ".partial-0123456789abcdef"} & tile_names(five)
    assert {"README.md", "old"} <= tile_names(five)
    assert tile_names(five) - {"README.md", "old"} == listed(five)


def test_what_cannot_be_removed_is_named(five: MapStore) -> None:
    stubborn = Path(five.location) / "tiles" / f"{0:016x}-{'0' * 32}.npz"
    stubborn.mkdir()
    for act in (five.clean, lambda: five.prune(1), lambda: StoredMap(five).update(cloud(9))):
        with pytest.raises(InputError, match=f"cannot remove .*{stubborn.name}"):
            act()
    assert five.manifest().number == 5


def test_cleaning_spares_young_files(five: MapStore) -> None:
    path = Path(five.location) / "tiles" / f"{0:016x}-{'0' * 32}.npz"
    path.write_bytes(b"")
    assert five.clean(older=3600) == 0
    assert path.exists()
    assert five.clean() == 1
    assert not path.exists()


def test_cleaning_never_guesses_with_a_damaged_manifest(five: MapStore) -> None:
    (Path(five.location) / "manifests" / "00000003.json").write_bytes(b"damaged")
    before = tile_names(five)
    with pytest.raises(FileFormatError, match=r"00000003\.json"):
        five.clean()
    with StoredMap(five) as writer:
        writer.update(cloud(9))
    assert before <= tile_names(five)
    assert StoredMap(five).clouds == 5
