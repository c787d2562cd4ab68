"""Versions: numbered, kept and rolled back; the layout of the files on disk is what is documented."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from semgp.errors import FileFormatError, InputError
from semgp.store import Manifest, MapStore, StoredMap
from semgp.store.tile_files import encode
from tests.store.scenes import (
    FORGETTING,
    FREE,
    PLAIN,
    assert_same,
    cloud,
    in_memory,
    places,
    rewrite,
    signed,
    stored,
)


def test_versions_count_from_one_and_keep_their_notes(five: MapStore) -> None:
    assert five.numbers() == [1, 2, 3, 4, 5]
    assert [five.manifest(n).note for n in five.numbers()] == ["begun", *(f"cloud {i}" for i in range(4))]
    times = [five.manifest(n).time for n in five.numbers()]
    assert times == sorted(times)
    assert five.manifest().number == 5


@pytest.mark.parametrize("number", [1, 2, 4])
def test_older_versions_stay_what_they_were(five: MapStore, number: int) -> None:
    old = StoredMap(five, number)
    assert old.clouds == number - 1
    if number > 1:
        wanted = in_memory(PLAIN, *(cloud(i, 3.0 * i) for i in range(number - 1)))
        assert_same(old.query(places(1)), wanted.query(places(1)))


def test_unknown_versions_say_which_there_are(five: MapStore, tmp_path: Path) -> None:
    for number in (0, 6, -1):
        with pytest.raises(InputError, match=f"no version {number}, but 1 to 5"):
            five.manifest(number)
        with pytest.raises(InputError, match="no version"):
            five.roll_back(number)
    with pytest.raises(InputError, match="holds no map"):
        MapStore(tmp_path / "elsewhere").manifest()


def test_roll_back_publishes_the_old_version_again(five: MapStore) -> None:
    manifest = five.roll_back(3)
    assert (manifest.number, manifest.note, manifest.clouds) == (6, "version 3 again", 2)
    assert manifest.tiles == five.manifest(3).tiles
    assert five.roll_back(5, "on second thoughts").note == "on second thoughts"
    assert five.manifest().tiles == five.manifest(5).tiles
    with StoredMap(five) as mine:
        mine.update(cloud(9))
    wanted = in_memory(PLAIN, *(cloud(i, 3.0 * i) for i in range(4)), cloud(9))
    assert_same(StoredMap(five).query(places(1)), wanted.query(places(1)))


@pytest.mark.parametrize("number", [1, 2, 3])
def test_updates_of_a_version_that_was_rolled_back_are_added_to_what_is_left(five: MapStore, number: int) -> None:
    mine = StoredMap(five)
    mine.update(cloud(9, 2.0))
    five.roll_back(number)
    mine.commit()
    assert list(five.check()) == []
    clouds = [*(cloud(i, 3.0 * i) for i in range(number - 1)), cloud(9, 2.0)]
    assert mine.clouds == StoredMap(five).clouds == len(clouds)
    assert_same(mine.query(places(1)), in_memory(PLAIN, *clouds).query(places(1)))
    assert_same(StoredMap(five).query(places(1)), in_memory(PLAIN, *clouds).query(places(1)))


def test_a_newer_format_says_so(five: MapStore) -> None:
    path = rewrite(five, lambda plain: plain.update(version=99))
    with pytest.raises(FileFormatError, match="newer semgp") as caught:
        StoredMap(five)
    assert caught.value.path == path
    assert "store versions" in str(caught.value)
    assert StoredMap(five, 4).clouds == 3


@pytest.mark.parametrize("settings", [PLAIN, FREE, FORGETTING])
def test_manifests_are_two_lines_that_make_the_same_manifest(settings: object, tmp_path: Path) -> None:
    made = stored(tmp_path / "map", cloud(0), settings=settings)  # type: ignore[arg-type]
    manifest = made.store.manifest()
    data = (tmp_path / "map" / "manifests" / "00000002.json").read_bytes()
    digest, line, nothing = data.split(b"\n")
    assert nothing == b""
    assert hashlib.sha256(line).hexdigest() == digest.decode()
    plain = json.loads(line)
    assert (plain["format"], plain["version"], plain["number"], plain["clouds"]) == ("semgp-store", 1, 2, 1)
    assert Manifest.from_bytes(data) == manifest
    assert signed(line.decode()) == manifest.to_bytes() == data


def test_the_layout_is_the_documented_one(five: MapStore) -> None:
    folder = Path(five.location)
    assert {p.name for p in folder.iterdir()} == {"manifests", "tiles", "writers.lock"}
    assert sorted(p.name for p in (folder / "manifests").iterdir()) == [f"{n:08d}.json" for n in range(1, 6)]
    manifest = five.manifest()
    for key, tile in manifest.tiles.items():
        path = folder / "tiles" / tile.name(key)
        data = path.read_bytes()
        assert path.name == f"{key:016x}-{hashlib.sha256(data).hexdigest()[:32]}.npz"
        assert (len(data), hashlib.sha256(data).hexdigest()) == (tile.n_bytes, tile.digest)
        assert encode(five.get(key, tile, manifest.settings)) == data
        with np.load(path) as arrays:  # no pickles
            types = {"voxels": "<i8", "n_classes": "<u2", "class": "<u2", "mass": "<u4", "place": "<i8"}
            assert {name: arrays[name].dtype.str for name in arrays.files} == types
            keys = arrays["voxels"].cumsum()
            assert (np.diff(keys) > 0).all()
            assert len(keys) == tile.sites
            assert arrays["n_classes"].sum() == len(arrays["class"]) == len(arrays["mass"])
            assert (keys >= key).all()


def test_the_folder_is_not_written_by_readers(five: MapStore) -> None:
    def state() -> list[tuple[str, int]]:
        return sorted((str(p), p.stat().st_mtime_ns) for p in Path(five.location).rglob("*"))

    before = state()
    mine = StoredMap(five)
    mine.query(places(1))
    mine.refresh()
    mine.load()
    assert list(five.check()) == []
    assert state() == before


def test_a_damaged_tile_is_written_anew_with_the_same_content(tmp_path: Path) -> None:
    store = stored(tmp_path / "map", cloud(0)).store
    path = sorted((tmp_path / "map" / "tiles").iterdir())[0]
    path.write_bytes(path.read_bytes()[:-1])
    assert len(list(store.check())) == 1
    store.roll_back(1)
    with StoredMap(store) as again:
        again.update(cloud(0))
    assert list(store.check()) == list(store.check(2)) == []
