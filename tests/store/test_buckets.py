"""Stores in buckets: the same map as in a folder, by obstore's stores in memory and on disk."""

import sys
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from semgp.errors import ConflictError, FileFormatError, InputError, MissingExtraError
from semgp.executors import Threads
from semgp.maps.files import load_map
from semgp.store import MapStore, StoredMap, build
from semgp.store.bucket import BucketFiles, as_url, open_files
from semgp.store.files import LocalFiles
from tests.store.scenes import FREE, PLAIN, assert_same, cloud, in_memory, places, stored

obstore = pytest.importorskip("obstore", reason="buckets need the extra cloud")


@pytest.fixture(params=["memory", "local"])
def bucket(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """An object store; nothing of it is an error of the system's."""
    from obstore.store import LocalStore, MemoryStore

    return MemoryStore() if request.param == "memory" else LocalStore(tmp_path)


def opened(bucket: Any) -> MapStore:
    return MapStore("mem://bucket/drive", BucketFiles(bucket, "mem://bucket/drive"))


def test_a_map_in_a_bucket_is_the_map_in_a_folder(bucket: Any, tmp_path: Path) -> None:
    store = opened(bucket)
    clouds = [cloud(i, 4.0 * i) for i in range(3)]
    with StoredMap.create(store, FREE, most_sites=200) as made:
        for one in clouds:
            made.update(one)
    wanted = in_memory(FREE, *clouds).query(places(1))
    assert_same(StoredMap(opened(bucket)).query(places(1)), wanted)
    folder = stored(tmp_path / "folder", *clouds, settings=FREE).store
    assert store.manifest().tiles == folder.manifest().tiles
    assert list(store.check()) == []
    assert StoredMap(store).info()["store"] == "mem://bucket/drive"


def test_builds_versions_and_cleaning(bucket: Any) -> None:
    store = opened(bucket)
    store.create(PLAIN)
    build(store, [cloud(i) for i in range(4)], Threads(2), batch=1)
    assert store.numbers() == [1, 2, 3]
    store.roll_back(2)
    obstore.put(bucket, f"tiles/{0:016x}-{'0' * 32}.npz", b"left by a writer that died")
    assert store.clean(older=3600) == 0
    assert store.clean() == 1
    store.tidy()
    assert store.prune(1) > 0
    assert store.numbers() == [4]
    assert StoredMap(store).clouds == 2


def test_writers_in_a_bucket_conflict_and_add_up(bucket: Any) -> None:
    store = opened(bucket)
    with StoredMap.create(store, PLAIN) as made:
        made.update(cloud(0))
    a, b = StoredMap(opened(bucket)), StoredMap(opened(bucket))
    a.update(cloud(1))
    b.update(cloud(2))
    b.commit()
    with pytest.raises(ConflictError):
        a.commit(merge=False)
    a.commit()
    assert_same(a.query(places(1)), in_memory(PLAIN, *(cloud(i) for i in range(3))).query(places(1)))


def test_files_in_a_bucket(bucket: Any) -> None:
    files = BucketFiles(bucket, "mem://bucket")
    assert files.names("tiles") == []
    assert files.create("tiles/a", b"one")
    assert not files.create("tiles/a", b"two")
    assert files.read("tiles/a") == b"one"
    assert files.names("tiles") == ["a"]
    assert 0 <= files.age("tiles/a") < 60
    assert files.age("tiles/b") == 0
    assert files.remove_partial() == 0
    files.remove("tiles/a")
    files.remove("tiles/a")
    with pytest.raises(FileFormatError, match="mem://bucket/tiles/a: no such file"):
        files.read("tiles/a")


def test_damage_names_the_url(bucket: Any) -> None:
    store = opened(bucket)
    with StoredMap.create(store, PLAIN) as made:
        made.update(cloud(0))
    key, tile = sorted(store.manifest().tiles.items())[0]
    obstore.put(bucket, f"tiles/{tile.name(key)}", b"damaged")
    (error,) = store.check()
    assert str(error).startswith(f"mem://bucket/drive/tiles/{tile.name(key)}: is damaged")


@pytest.mark.parametrize(
    ("location", "url"),
    [
        ("s3://maps/drive", "s3://maps/drive"),
        ("s3:/maps/drive", "s3://maps/drive"),
        ("gs://maps/a b", "gs://maps/a b"),
        ("az://container/x/y", "az://container/x/y"),
        ("drive", None),
        ("/data/s3/drive", None),
        ("./s3:drive", None),
        ("C:/maps/drive", None),
        ("", None),
    ],
)
def test_urls_are_told_from_paths(location: str, url: str | None) -> None:
    assert as_url(location) == url
    if location.startswith("s3") and url is not None:
        assert as_url(Path(location)) == url


def test_load_map_opens_urls(bucket: Any) -> None:
    with mock.patch("semgp.store.store.open_files", return_value=BucketFiles(bucket, "mem://bucket")):
        with StoredMap.create("mem://bucket", PLAIN) as made:
            made.update(cloud(0))
        again = load_map("mem://bucket")
    assert isinstance(again, StoredMap)
    assert_same(again.query(places(1)), in_memory(PLAIN, cloud(0)).query(places(1)))


@pytest.mark.parametrize("url", ["nosuch://bucket/x", "s3+x://bucket", "s3://"])
def test_urls_of_nothing_that_is_known(url: str) -> None:
    with pytest.raises(InputError, match="cannot be opened"):
        MapStore(url)


def test_without_obstore_the_extra_is_named() -> None:
    with mock.patch.dict(sys.modules, {"obstore": None, "obstore.store": None}):
        with pytest.raises(MissingExtraError, match=r"semgp\[cloud\]"):
            MapStore("s3://maps/drive")
        assert isinstance(open_files("maps/drive"), LocalFiles)
