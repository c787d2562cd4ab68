"""Old versions that are dropped while a map is written and read: what stays is whole, and nobody is misled."""

import multiprocessing
from pathlib import Path
from unittest import mock

import pytest

from semgp.errors import ConflictError, FileFormatError, InputError
from semgp.store import Manifest, MapStore, StoredMap
from semgp.store.files import LocalFiles
from tests.store.scenes import PLAIN, assert_same, cloud, crowd, in_memory, places, stored


def test_what_is_dropped_is_gone_and_the_rest_is_whole(crowded: MapStore) -> None:
    tiles = Path(crowded.location) / "tiles"
    before = len(list(tiles.iterdir()))
    gone = crowded.drop([2, 4, 5, 77])  # the newest is never dropped
    assert gone is not None
    assert gone == before - len(list(tiles.iterdir())) > 0
    assert crowded.numbers() == [1, 3, 5]
    assert_same(StoredMap(crowded, 3).query(places(1)), crowd(0, 1))
    assert_same(StoredMap(crowded).query(places(1)), crowd(0, 1, 2, 3))
    with pytest.raises(InputError, match="no version 4, but 1, 3, 5"):
        crowded.manifest(4)
    assert crowded.drop([1, 3]) is not None
    assert crowded.numbers() == [5]
    assert crowded.roll_back(5).number == 6


def test_a_tile_that_another_version_lists_stays(crowded: MapStore) -> None:
    crowded.roll_back(2)
    crowded.drop([2, 3, 4, 5])
    assert crowded.numbers() == [1, 6]
    assert list(crowded.check()) == []
    assert_same(StoredMap(crowded).query(places(1)), crowd(0))


def test_nothing_is_dropped_while_another_writer_is_at_work(crowded: MapStore) -> None:
    writer = StoredMap(crowded)
    writer.update(cloud(9, 1.0))
    files = sorted(Path(crowded.location).rglob("*"))
    assert crowded.drop([1, 2]) is None
    assert sorted(Path(crowded.location).rglob("*")) == files
    writer.commit()
    assert crowded.drop([1, 2]) is not None
    assert crowded.numbers() == [3, 4, 5, 6]
    writer.update(cloud(10, 1.0))  # the one that has committed goes on
    writer.commit()
    assert_same(StoredMap(crowded).query(places(1)), crowd(0, 1, 2, 3, 9, 10))


def test_a_reader_of_what_was_dropped_is_told_to_refresh(crowded: MapStore) -> None:
    reader = StoredMap(crowded, 3)
    crowded.drop([3])
    for act in (lambda: reader.query(places(1)), reader.load, lambda: reader.crop((0, 0, -1), (1, 1, 1))):
        with pytest.raises(ConflictError, match=r"version 3 has been removed.*refresh"):
            act()
    assert reader.refresh() == 5
    assert_same(reader.query(places(1)), crowd(0, 1, 2, 3))


def test_what_is_in_memory_is_answered_on(crowded: MapStore) -> None:
    reader = StoredMap(crowded, 3)
    before = reader.query(places(1))
    crowded.drop([3])
    assert_same(reader.query(places(1)), before)


def test_a_writer_of_what_was_dropped_is_told_before_it_begins(crowded: MapStore) -> None:
    writer = StoredMap(crowded, 3)
    crowded.drop([3])
    for _ in range(2):
        with pytest.raises(ConflictError, match="version 3 has been removed"):
            writer.update(cloud(9, 1.0))
        assert MapStore(crowded.location).drop([]) is not None  # it does not count as a writer
    assert writer.clouds == 2
    writer.refresh()
    writer.update(cloud(9, 1.0))
    assert writer.commit() == 6
    assert_same(StoredMap(crowded).query(places(1)), crowd(0, 1, 2, 3, 9))


def test_a_number_that_is_free_again_is_not_taken(crowded: MapStore) -> None:
    old = crowded.manifest(2)
    crowded.drop([3, 4])
    with pytest.raises(ConflictError, match="version 5 since version 2"):
        crowded.publish(old)
    with pytest.raises(ConflictError, match="version 5 since version 0"):
        crowded.publish(Manifest(0, PLAIN, ""))
    assert crowded.numbers() == [1, 2, 5]


def test_the_newest_may_go_while_it_is_opened(crowded: MapStore) -> None:
    read = LocalFiles.read

    def overtaken(files: LocalFiles, name: str) -> bytes:
        with mock.patch.object(LocalFiles, "read", read):
            if crowded.numbers()[-1] == 5:
                crowded.roll_back(4)
                crowded.prune(1)
        return read(files, name)

    with mock.patch.object(LocalFiles, "read", overtaken):
        assert crowded.manifest().number == 6
        with pytest.raises(InputError, match="no version 5, but 6"):
            crowded.manifest(5)


def test_a_damaged_manifest_stops_the_removal_of_tiles(crowded: MapStore) -> None:
    damaged = Path(crowded.location) / "manifests" / "00000003.json"
    damaged.write_bytes(b"damaged")
    tiles = set((Path(crowded.location) / "tiles").iterdir())
    with pytest.raises(FileFormatError, match=damaged.name):
        crowded.drop([2])
    assert set((Path(crowded.location) / "tiles").iterdir()) == tiles
    assert crowded.drop([3]) == 2 * len(crowded.manifest(4).tiles)  # those of the second version, too
    assert list(crowded.check()) == []


def write(place: Path, n: int) -> None:
    """Commit clouds from another process, and keep the newest version only."""
    store = MapStore(place)
    with StoredMap(store) as mine:
        for i in range(n):
            mine.update(cloud(100 + i, 1.0, n=80))
            mine.commit()
            store.drop(store.numbers()[:-1])


def test_readers_beside_a_process_that_drops_see_whole_versions_or_are_told(tmp_path: Path) -> None:
    stored(tmp_path / "map", cloud(0, 1.0))
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.store.test_dropping"])
    writer = context.Process(target=write, args=(tmp_path / "map", 12))
    writer.start()
    answered, told = {}, 0
    while writer.is_alive():
        reader = StoredMap(tmp_path / "map")
        try:
            answered[reader.clouds] = reader.query(places(1))
        except ConflictError:
            told += 1
    writer.join()
    assert writer.exitcode == 0
    assert answered
    for clouds, answer in answered.items():
        more = [cloud(100 + i, 1.0, n=80) for i in range(clouds - 1)]
        assert_same(answer, in_memory(PLAIN, cloud(0, 1.0), *more).query(places(1)))
    assert MapStore(tmp_path / "map").numbers() == [14]
