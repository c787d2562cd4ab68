"""Several writers at once: nothing is lost, nobody waits, and what cannot be added up is refused."""

import multiprocessing
from pathlib import Path

import numpy as np
import pytest

from semgp.errors import ConflictError, InputError
from semgp.executors import Threads
from semgp.store import MapStore, StoredMap, build
from tests.store.scenes import FORGETTING, FREE, PLAIN, assert_same, cloud, in_memory, places, stored, uncertain

BEGUN = cloud(0, 5.0)


@pytest.mark.parametrize("settings", [PLAIN, FREE])
@pytest.mark.parametrize("x", [5.0, 8.0, 30.0])
def test_two_writers_add_up(settings: object, x: float, tmp_path: Path) -> None:
    a = stored(tmp_path / "map", BEGUN, settings=settings)  # type: ignore[arg-type]
    b = StoredMap(tmp_path / "map", most_sites=100)
    a.update(cloud(1, 4.0))
    b.update(cloud(2, x))
    b.update(cloud(3, 6.0))
    assert (b.commit(), a.commit()) == (3, 4)
    wanted = in_memory(a.settings, BEGUN, cloud(1, 4.0), cloud(2, x), cloud(3, 6.0)).query(places(1))
    assert_same(a.query(places(1)), wanted)
    assert_same(StoredMap(tmp_path / "map").query(places(1)), wanted)
    assert a.clouds == 4
    b.refresh()
    assert_same(b.query(places(1)), wanted, 1e-5)


def test_certain_and_uncertain_positions_add_up(tmp_path: Path) -> None:
    a, b = stored(tmp_path / "map", BEGUN), StoredMap(tmp_path / "map")
    a.update(uncertain(1, 5.0))
    b.update(cloud(2, 5.0))
    b.update(uncertain(3, 6.0))
    b.commit()
    a.commit()
    wanted = in_memory(PLAIN, BEGUN, uncertain(1, 5.0), cloud(2, 5.0), uncertain(3, 6.0))
    assert_same(a.query(places(1)), wanted.query(places(1)))


def test_without_merging_the_slower_one_is_told_and_may_try_again(tmp_path: Path) -> None:
    a, b = stored(tmp_path / "map", BEGUN), StoredMap(tmp_path / "map")
    a.update(cloud(1, 5.0))
    b.update(cloud(2, 5.0))
    b.commit(merge=False)
    for _ in range(2):
        with pytest.raises(ConflictError, match="version 3 since version 2"):
            a.commit(merge=False)
    assert StoredMap(tmp_path / "map").clouds == 2
    assert a.clouds == 2  # its own updates are still there
    MapStore(tmp_path / "map").tidy()
    assert a.commit() == 4
    wanted = in_memory(PLAIN, BEGUN, cloud(1, 5.0), cloud(2, 5.0))
    assert_same(a.query(places(1)), wanted.query(places(1)))
    assert_same(StoredMap(tmp_path / "map").query(places(1)), wanted.query(places(1)))


def test_maps_that_forget_conflict_in_the_same_places_only(tmp_path: Path) -> None:
    a, b = stored(tmp_path / "map", BEGUN, settings=FORGETTING), StoredMap(tmp_path / "map")
    a.update(cloud(1, 5.0))
    b.update(cloud(2, 6.0))
    b.commit()
    with pytest.raises(ConflictError, match="forgotten cannot be added up"):
        a.commit()
    a = StoredMap(tmp_path / "map")
    a.update(cloud(1, 5.0))
    a.commit()
    wanted = in_memory(FORGETTING, BEGUN, cloud(2, 6.0), cloud(1, 5.0))
    assert_same(a.query(places(1)), wanted.query(places(1)))
    c = StoredMap(tmp_path / "map")
    a.update(cloud(3, 5.0))
    c.update(cloud(4, 40.0))  # elsewhere
    a.commit()
    c.commit()
    assert c.clouds == 5
    assert len(list(c.store.check())) == 0


def test_two_that_begin_a_map_at_one_place_add_up(tmp_path: Path) -> None:
    a = StoredMap.create(tmp_path / "map", PLAIN)
    b = StoredMap(tmp_path / "map")
    a.update(cloud(1, n=100))
    b.update(cloud(1, n=100))
    a.commit()
    b.commit()
    wanted = in_memory(PLAIN, cloud(1, n=100), cloud(1, n=100))
    assert_same(b.query(places(1)), wanted.query(places(1)))


def test_two_that_begin_a_map_at_different_places_conflict(tmp_path: Path) -> None:
    a = StoredMap.create(tmp_path / "map", PLAIN)
    b = StoredMap(tmp_path / "map")
    a.update(cloud(1))
    b.update(cloud(1, 50.0))
    a.commit()
    with pytest.raises(ConflictError, match="at different places"):
        b.commit()
    assert_same(StoredMap(tmp_path / "map").query(places(1)), in_memory(PLAIN, cloud(1)).query(places(1)))


def test_two_that_create_a_map_at_once(tmp_path: Path) -> None:
    store = MapStore(tmp_path / "map")
    store.create(PLAIN)
    with pytest.raises((InputError, ConflictError)):
        store.create(FREE)
    assert store.manifest().settings == PLAIN


def test_a_build_is_told_of_another_writer(tmp_path: Path) -> None:
    store = stored(tmp_path / "map", BEGUN).store

    def interfere(_: int) -> None:
        if store.numbers()[-1] == 2:
            with StoredMap(tmp_path / "map") as other:
                other.update(cloud(1))

    with pytest.raises(ConflictError, match="version 3"):
        build(store, [cloud(2), cloud(3)], Threads(1), batch=1, steps=interfere)
    assert store.manifest().clouds == 2
    assert build(store, [cloud(2), cloud(3)], Threads(1)).clouds == 4
    wanted = in_memory(PLAIN, BEGUN, *(cloud(i) for i in (1, 2, 3)))
    assert_same(StoredMap(store).query(places(1)), wanted.query(places(1)))


def test_readers_see_their_version_until_they_refresh(tmp_path: Path) -> None:
    reader = stored(tmp_path / "map", BEGUN, most_sites=10)
    before = reader.query(places(1))
    writer = StoredMap(tmp_path / "map")
    for i in range(1, 5):
        writer.update(cloud(i, 5.0))
        assert_same(reader.query(places(1)), before)  # while the writer has its lock
        writer.commit()
        assert_same(reader.query(places(1)), before)
    assert reader.refresh() == 6
    assert (reader.query(places(1)).probability != before.probability).any()


def test_close_forgets_what_is_not_committed(tmp_path: Path) -> None:
    mine = stored(tmp_path / "map", BEGUN, most_sites=100)
    for i in range(1, 4):
        mine.update(cloud(i, 7.0 * i))
    mine.close()
    MapStore(tmp_path / "map").tidy()
    assert mine.commit() == mine.version == 2
    assert_same(mine.query(places(1)), StoredMap(tmp_path / "map").query(places(1)))
    assert list(MapStore(tmp_path / "map").check()) == []


def write(place: Path, seed: int, n: int) -> None:
    """Commit some clouds, one version each, from another process."""
    with StoredMap(place, most_sites=300) as mine:
        for i in range(n):
            mine.update(cloud(100 * seed + i, 3.0 * (i % 3), n=80))
            mine.commit(f"writer {seed}")
            mine.refresh()


def test_many_processes_lose_nothing(tmp_path: Path) -> None:
    stored(tmp_path / "map", BEGUN)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.store.test_conflicts"])
    writers = [context.Process(target=write, args=(tmp_path / "map", seed, 3)) for seed in range(1, 5)]
    for writer in writers:
        writer.start()
    reader = StoredMap(tmp_path / "map")
    seen = [reader.version]
    while any(writer.is_alive() for writer in writers):
        seen.append(reader.refresh())
        assert reader.query(places(1, 20)).observed.any()
    for writer in writers:
        writer.join()
        assert writer.exitcode == 0
    assert seen == sorted(seen)
    store = MapStore(tmp_path / "map")
    assert store.numbers() == list(range(1, 15))
    notes = [store.manifest(n).note for n in store.numbers()]
    assert sorted(notes) == sorted(["", "", *(f"writer {s}" for s in range(1, 5) for _ in range(3))])
    assert [store.manifest(n).clouds for n in store.numbers()] == list(range(14))
    clouds = [cloud(100 * s + i, 3.0 * (i % 3), n=80) for s in range(1, 5) for i in range(3)]
    wanted = in_memory(PLAIN, BEGUN, *clouds)
    made = StoredMap(store)
    assert_same(made.query(places(1)), wanted.query(places(1)))
    mass = sum(int(arrays["mass"].sum(dtype=np.int64)) for _, arrays in made.parts())
    assert mass == int(wanted.to_arrays()[1]["mass"].sum(dtype=np.int64))
    store.tidy()
    listed = {t.name(k) for n in store.numbers() for k, t in store.manifest(n).tiles.items()}
    assert {p.name for p in (tmp_path / "map" / "tiles").iterdir()} == listed
