"""Damaged and hostile manifests: an error that names the file, never another exception."""

import hashlib
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.errors import FileFormatError, InputError
from semgp.store import Manifest, MapStore, StoredMap
from tests.store.hostile import (
    FEW,
    Plain,
    assert_refused,
    use,
)
from tests.store.scenes import (
    manifest_path,
    rewrite,
    signed,
)


@pytest.mark.parametrize("seed", range(20))
def test_bits_that_flip_in_a_manifest_are_noticed(store: MapStore, seed: int) -> None:
    path, rng = manifest_path(store), random.Random(seed)
    data = bytearray(path.read_bytes())
    data[rng.randrange(len(data) - 1)] ^= 1 << rng.randrange(8)
    path.write_bytes(data)
    assert_refused(store, path)


@pytest.mark.parametrize("keep", [0, 1, 64, 65, 66, 500, -2])
def test_manifests_cut_short_are_noticed(store: MapStore, keep: int) -> None:
    path = manifest_path(store)
    path.write_bytes(path.read_bytes()[:keep])
    assert "store versions" in str(assert_refused(store, path))
    assert StoredMap(store, 1).clouds == 0


TEXTS = {
    "no JSON": "{",
    "a list": "[]",
    "a number": "1",
    "null": "null",
    "nothing": "{}",
    "deep": "[" * 100_000 + "]" * 100_000,
    "deep object": '{"a":' * 50_000 + "1" + "}" * 50_000,
    "digits": '{"format":"semgp-store","version":' + "9" * 5000 + "}",
    "no text": "\udcff",
}


@pytest.mark.parametrize("name", TEXTS)
def test_texts_that_are_no_manifest(store: MapStore, name: str) -> None:
    path = manifest_path(store)
    line = TEXTS[name].encode(errors="surrogateescape")
    path.write_bytes(hashlib.sha256(line).hexdigest().encode() + b"\n" + line + b"\n")
    assert_refused(store, path)


def tiles_of(change: Callable[[list[Any]], Any]) -> Callable[[Plain], Any]:
    return lambda plain: plain.update(tiles=[change(plain["tiles"][0]), *plain["tiles"][1:]])


def setting(name: str, value: Any) -> Callable[[Plain], Any]:
    return lambda plain: plain.update({name: value})


def of_model(name: str, value: Any) -> Callable[[Plain], Any]:
    return lambda plain: plain["model"].update({name: value})


WRONG: dict[str, Callable[[Plain], Any]] = {
    "format": setting("format", "zip"),
    "version 0": setting("version", 0),
    "version -1": setting("version", -1),
    "version true": setting("version", True),
    "version text": setting("version", "1"),
    "version null": setting("version", None),
    "other number": setting("number", 7),
    "number 0": setting("number", 0),
    "clouds below 0": setting("clouds", -1),
    "clouds NaN": setting("clouds", float("nan")),
    "clouds 1.5": setting("clouds", 1.5),
    "clock NaN": setting("clock", float("nan")),
    "clock inf": setting("clock", float("inf")),
    "clock text": setting("clock", "5"),
    "origin beside a cell": setting("origin", [1, 0, 0]),
    "origin of two": setting("origin", [0, 0]),
    "origin far": setting("origin", [1 << 62, 0, 0]),
    "origin beyond": setting("origin", [1 << 70, 0, 0]),
    "origin -2^63": setting("origin", [-(1 << 63), 0, 0]),
    "origin fraction": setting("origin", [0.5, 0, 0]),
    "origin missing": setting("origin", None),
    "tile size": setting("tile_cells", 5),
    "tile size 4.0": setting("tile_cells", 4.0),
    "larger tiles": setting("tile_cells", 32),
    "tiles missing": setting("tiles", None),
    "tiles an object": setting("tiles", {"../../etc/passwd": 1}),
    "tile a path": tiles_of(lambda row: ["../../../etc/passwd", *row[1:]]),
    "digest a path": tiles_of(lambda row: [row[0], "../../../../../etc/passwd", *row[2:]]),
    "digest absolute": tiles_of(lambda row: [row[0], "/etc/passwd" + "0" * 53, *row[2:]]),
    "digest capital": tiles_of(lambda row: [row[0], row[1].upper(), *row[2:]]),
    "digest and newline": tiles_of(lambda row: [row[0], row[1] + "\n", *row[2:]]),
    "digest short": tiles_of(lambda row: [row[0], row[1][:63], *row[2:]]),
    "key in a tile": tiles_of(lambda row: [row[0] + 1, *row[1:]]),
    "key below 0": tiles_of(lambda row: [-row[0], *row[1:]]),
    "key beyond 2^63": tiles_of(lambda row: [1 << 63, *row[1:]]),
    "key 2^200": tiles_of(lambda row: [1 << 200, *row[1:]]),
    "key a float": tiles_of(lambda row: [float(row[0]), *row[1:]]),
    "key twice": lambda plain: plain["tiles"].append(plain["tiles"][0]),
    "row short": tiles_of(lambda row: row[:-1]),
    "row long": tiles_of(lambda row: [*row, 0]),
    "sites below 0": tiles_of(lambda row: [*row[:3], -1, row[4]]),
    "sites many": tiles_of(lambda row: [*row[:3], 1 << 70, row[4]]),
    "free sites many": tiles_of(lambda row: [*row[:4], 1 << 40]),
    "bytes below 0": tiles_of(lambda row: [*row[:2], -1, *row[3:]]),
    "classes twice": setting("classes", {"names": ["a", "a"], "colours": [[0, 0, 0]] * 2}),
    "no classes": setting("classes", {"names": [], "colours": []}),
    "classes a text": setting("classes", "abc"),
    "model missing": setting("model", None),
    "free a list": setting("free", []),
    "free empty": setting("free", {}),
    "forgetting alone": setting("free", None),
    "half-life": setting("forgetting", {"half_life": -1}),
    "huge blocks": of_model("leaf", 10**9),
    "huge blend": of_model("blend", 1e6),
    "resolution 0": of_model("resolution", 0),
    "resolution NaN": of_model("resolution", float("nan")),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_manifests_that_say_what_cannot_be(store: MapStore, name: str) -> None:
    assert_refused(store, rewrite(store, WRONG[name]))


@pytest.mark.parametrize("name", ["sites", "classes", "origin"])
def test_manifests_that_do_not_fit_their_tiles(store: MapStore, name: str) -> None:
    change = {
        "sites": tiles_of(lambda row: [*row[:3], row[3] + 1, row[4]]),
        "classes": setting("classes", {"names": ["one", "two"], "colours": [[0, 0, 0]] * 2}),
        "origin": tiles_of(lambda row: row),
    }[name]
    rewrite(store, change)
    if name == "origin":  # another origin is another place: the tiles fit, the map lies elsewhere
        rewrite(store, lambda plain: plain.update(origin=[v + 640 for v in plain["origin"]]))
        moved = StoredMap(store)
        assert not moved.query(FEW).observed.any()
        return
    with pytest.raises(FileFormatError) as caught:
        use(store)
    assert caught.value.path.parent == Path(store.location) / "tiles"


def test_of_a_key_twice_in_an_object_the_last_counts_and_is_checked(store: MapStore) -> None:
    path = manifest_path(store)
    line = path.read_bytes().split(b"\n")[1].decode()
    path.write_bytes(signed(line.replace('"clouds":2', '"clouds":2,"clouds":-5')))
    assert_refused(store, path)


def test_a_manifest_in_the_place_of_another(store: MapStore) -> None:
    manifest_path(store, 1).write_bytes(manifest_path(store, 2).read_bytes())
    with pytest.raises(FileFormatError, match="says that it is version 2"):
        store.manifest(1)


scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
anything = st.recursive(
    scalars, lambda c: st.lists(c, max_size=3) | st.dictionaries(st.text(max_size=6), c, max_size=3)
)


@given(data=st.data())
@settings(deadline=None, max_examples=300)
def test_whatever_a_signed_manifest_holds_it_is_read_or_refused(whole: Path, data: st.DataObject) -> None:
    plain = json.loads(manifest_path(MapStore(whole)).read_bytes().split(b"\n")[1])
    at: Any = plain
    while True:
        place = data.draw(st.sampled_from(sorted(at) if isinstance(at, dict) else range(len(at))))
        inner = at[place]
        if not isinstance(inner, dict | list) or not inner or data.draw(st.booleans()):
            break
        at = inner
    at[place] = data.draw(anything)
    try:
        made = Manifest.from_bytes(signed(plain))
    except InputError:
        return
    assert made.number >= 1
    assert all(tile.sites >= 0 for tile in made.tiles.values())
