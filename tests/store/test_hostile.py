"""Damaged and hostile files: an error that names the file, never another exception, never much memory."""

import hashlib
import io
import json
import os
import random
import shutil
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semgp.errors import FileFormatError, InputError
from semgp.maps.tiles import Arrays
from semgp.store import Manifest, MapStore, StoredMap
from semgp.store.tile_files import decode, encode
from tests.store.scenes import (
    FORGETTING,
    assert_same,
    cloud,
    in_memory,
    manifest_path,
    places,
    publish,
    replace_tile,
    rewrite,
    signed,
    stored,
)

Plain = dict[str, Any]


CLOUDS = cloud(0, n=60), cloud(1, 5.0, n=60)
FEW = CLOUDS[0].points[::3]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of two versions and some tiles, with all that a map can have."""
    folder = tmp_path_factory.mktemp("hostile") / "map"
    stored(folder, *CLOUDS, settings=FORGETTING)
    return folder


@pytest.fixture
def store(whole: Path, tmp_path: Path) -> MapStore:
    """A copy to spoil."""
    return MapStore(shutil.copytree(whole, tmp_path / "map"))


def use(store: MapStore) -> None:
    """Do all that reads."""
    made = StoredMap(store)
    made.info()
    len(made)
    made.query(FEW)
    made.load()


def assert_refused(store: MapStore, path: Path) -> FileFormatError:
    """Check that using a map fails, and that the file at fault is named."""
    with pytest.raises(FileFormatError) as caught:
        use(store)
    assert caught.value.path == path, str(caught.value)
    return caught.value


def failure(store: MapStore) -> FileFormatError | None:
    """Use a map, and return how that fails."""
    try:
        use(store)
    except FileFormatError as error:
        return error
    return None


def first_tile(store: MapStore) -> tuple[int, Path]:
    key, tile = sorted(store.manifest().tiles.items())[0]
    return key, Path(store.location) / "tiles" / tile.name(key)


# manifests


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


# tiles


@pytest.mark.parametrize("seed", range(20))
def test_bits_that_flip_in_a_tile_are_noticed(store: MapStore, seed: int) -> None:
    _, path = first_tile(store)
    rng = random.Random(seed)
    data = bytearray(path.read_bytes())
    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(data)
    assert_refused(store, path)
    assert [error.path for error in store.check()] == [path]


@pytest.mark.parametrize("seed", range(40))
def test_bits_that_flip_in_a_tile_with_a_checksum_that_fits(store: MapStore, seed: int) -> None:
    key, path = first_tile(store)
    rng = random.Random(seed)
    data = bytearray(path.read_bytes())
    for _ in range(rng.choice([1, 1, 3])):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path = replace_tile(store, key, bytes(data))
    error = failure(store)  # none for a bit of a date or of a label: no harm
    assert error is None or error.path == path


@pytest.mark.parametrize("keep", [0, 1, 100, -1, -30])
def test_tiles_cut_short_are_noticed(store: MapStore, keep: int) -> None:
    key, path = first_tile(store)
    data = path.read_bytes()[:keep]
    path.write_bytes(data)
    assert_refused(store, path)
    assert_refused(store, replace_tile(store, key, data))


def test_tiles_that_are_gone_or_no_files(store: MapStore, tmp_path: Path) -> None:
    _, path = first_tile(store)
    data = path.read_bytes()
    path.unlink()
    assert "no such file" in str(assert_refused(store, path))
    path.mkdir()
    assert_refused(store, path)
    path.rmdir()
    path.symlink_to("/dev/zero")
    assert_refused(store, path)
    path.unlink()
    path.symlink_to(path.name)
    assert_refused(store, path)
    path.unlink()
    os.mkfifo(path)
    assert_refused(store, path)
    path.unlink()
    (tmp_path / "kept elsewhere").write_bytes(data)
    path.symlink_to(tmp_path / "kept elsewhere")
    use(store)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read everything")
def test_an_unreadable_folder_is_named(store: MapStore) -> None:
    folder = Path(store.location) / "manifests"
    folder.chmod(0)
    try:
        with pytest.raises(FileFormatError, match="manifests"):
            StoredMap(store)
    finally:
        folder.chmod(0o700)


def test_places_that_can_be_no_store(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("no folder")
    for place in (file, file / "inside", tmp_path / ("x" * 300)):
        with pytest.raises(InputError, match=place.name[:20]):
            StoredMap(place)
        with pytest.raises(InputError, match=place.name[:20]):
            StoredMap.create(place, FORGETTING)
    assert file.read_text() == "no folder"


def test_a_tile_in_the_place_of_another(store: MapStore) -> None:
    manifest = store.manifest()
    (a, one), (b, other), *_ = sorted(manifest.tiles.items())
    publish(store, replace(manifest, tiles={**manifest.tiles, a: other}))
    path = Path(store.location) / "tiles" / other.name(a)
    assert_refused(store, path)  # there is no such file
    path.write_bytes((path.parent / other.name(b)).read_bytes())
    assert "in another tile" in str(assert_refused(store, path))
    assert one != other


def test_what_is_whole_stays_usable_beside_a_hostile_tile(store: MapStore) -> None:
    manifest = store.manifest()
    key = max(manifest.tiles)
    arrays = store.get(key, manifest.tiles[key], manifest.settings)
    replace_tile(store, key, encode(arrays | {"place": -arrays["place"]}))
    made = StoredMap(store)
    near = FEW[FEW[:, 0] < 1]
    wanted = in_memory(FORGETTING, *CLOUDS).query(near)
    for _ in range(2):
        with pytest.raises(FileFormatError, match=f"{key:016x}"):
            made.query(places(0))
        assert_same(made.query(near), wanted)


Change = Callable[[Arrays], Any]


def drop(name: str) -> Change:
    return lambda a: a.pop(name)


def put(name: str, value: Callable[[Arrays], Any]) -> Change:
    return lambda a: a.update({name: np.asarray(value(a))})


HOSTILE: dict[str, Change] = {
    **{f"no {name}": drop(name) for name in ("voxels", "n_classes", "class", "mass", "place", "free.mass")},
    "voxels of floats": put("voxels", lambda a: a["voxels"].astype(float)),
    "voxels of text": put("voxels", lambda a: a["voxels"].astype("U20")),
    "voxels of NaN": put("voxels", lambda a: np.full(len(a["voxels"]), np.nan)),
    "voxels of times": put("voxels", lambda a: a["voxels"].astype("M8[s]")),
    "voxels complex": put("voxels", lambda a: a["voxels"].astype(complex)),
    "voxels in rows": put("voxels", lambda a: a["voxels"][:, None]),
    "voxels big-endian": put("voxels", lambda a: a["voxels"].astype(">i8")),
    "one voxel": put("voxels", lambda a: a["voxels"][0]),
    "voxels twice": put("voxels", lambda a: np.append(a["voxels"][:-1], 0)),
    "voxels below 0": put("voxels", lambda a: -a["voxels"]),
    "voxels overflow": put("voxels", lambda a: np.full(len(a["voxels"]), 1 << 62)),
    "voxels short": put("voxels", lambda a: a["voxels"][:-1]),
    "classes beyond": put("class", lambda a: a["class"] + np.uint16(3)),
    "classes signed": put("class", lambda a: a["class"].astype(np.int16)),
    "classes short": put("class", lambda a: a["class"][:-1]),
    "masses 0": put("mass", lambda a: a["mass"] * 0),
    "masses floats": put("mass", lambda a: a["mass"].astype(np.float32)),
    "masses short": put("mass", lambda a: a["mass"][:-1]),
    "masses a scalar": put("mass", lambda a: a["mass"][0]),
    "no class each": put("n_classes", lambda a: a["n_classes"] * 0),
    "many classes each": put("n_classes", lambda a: a["n_classes"] * 0 + np.uint16(65535)),
    "counts a scalar": put("n_classes", lambda a: a["n_classes"][0]),
    "place left": put("place", lambda a: a["place"] * 100_000),
    "place negative": put("place", lambda a: -a["place"]),
    "place narrow": put("place", lambda a: a["place"][:, :2]),
    "place wide": put("place", lambda a: np.hstack([a["place"], a["place"]])),
    "place floats": put("place", lambda a: a["place"].astype(float)),
    "place records": put("place", lambda a: np.zeros(len(a["place"]), [("x", "i8")])),
    "spread narrow": put("spread", lambda a: np.zeros((len(a["place"]), 3), np.int64)),
    "spread negative": put("spread", lambda a: np.full((len(a["place"]), 4), -1, np.int64)),
    "times NaN": put("time", lambda a: a["time"] * np.nan),
    "times later than the clock": put("time", lambda a: np.append(a["time"][:-1] + 9, a["time"][-1])),
    "times short": put("time", lambda a: a["time"][:-1]),
    "cells twice": put("cells", lambda a: np.append(a["cells"][:1], a["cells"][1:] * 0)),
    "cells that are none": put("cells", lambda a: a["cells"] + 1),
    "cells elsewhere": put("cells", lambda a: a["cells"] + (1 << 50)),
}


def zipped(members: dict[str, bytes]) -> bytes:
    """A zip archive of .npy files of any content."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return file.getvalue()


def packed(arrays: Plain) -> bytes:
    """A tile file of any arrays."""
    members = {}
    for name, array in arrays.items():
        raw = io.BytesIO()
        np.lib.format.write_array(raw, np.asarray(array), allow_pickle=True)
        members[name] = raw.getvalue()
    return zipped(members)


def unpacked(data: bytes) -> Plain:
    with np.load(io.BytesIO(data)) as file:
        return dict(file)


@pytest.mark.parametrize("name", HOSTILE)
def test_tiles_that_hold_what_cannot_be(store: MapStore, name: str) -> None:
    key, path = first_tile(store)
    arrays = unpacked(path.read_bytes())
    HOSTILE[name](arrays)
    path = replace_tile(store, key, packed(arrays))
    made = StoredMap(store)
    with pytest.raises(FileFormatError) as caught:
        made.load()
    assert caught.value.path == path
    assert_refused(store, path)


def test_nothing_is_unpickled(store: MapStore) -> None:
    key, path = first_tile(store)
    arrays = unpacked(path.read_bytes()) | {"extra": np.array([os.getcwd, None], dtype=object)}
    assert "Python objects" in str(assert_refused(store, replace_tile(store, key, packed(arrays))))


def claims() -> bytes:
    """A tile whose array claims to be of 2^53 bytes."""
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<i8", "fortran_order": False, "shape": (1 << 50,)})
    return zipped({"voxels": header.getvalue()})


def wide() -> bytes:
    """Sites without a class, so that little would become S x 65535 masses."""
    n = 6 << 20
    none: Plain = {"class": np.zeros(0, np.uint16), "mass": np.zeros(0, np.uint32)}
    return packed({"voxels": np.ones(n, np.int64), "n_classes": np.zeros(n, np.uint16), **none})


def many_classes() -> bytes:
    """Sites that are well, but of 65535 classes."""
    n = 1 << 18
    sites: Plain = {"voxels": np.ones(n, np.int64), "place": np.zeros((n, 3), np.int64)}
    masses = {"n_classes": np.ones(n, np.uint16), "class": np.zeros(n, np.uint16), "mass": np.ones(n, np.uint32)}
    return packed(sites | masses)


def lying() -> bytes:
    """An archive whose directory says that its member has 100 bytes."""
    data = bytearray(packed({"voxels": np.zeros(1 << 24, np.int64)}))
    at = data.rindex(b"PK\x01\x02")
    data[at + 24 : at + 28] = struct.pack("<I", 100)
    return bytes(data)


BOMBS: dict[str, Callable[[], bytes]] = {
    "zeros": lambda: packed({"voxels": np.zeros(1 << 24, np.int64)}),
    "claims": claims,
    "wide": wide,
    "many classes": many_classes,
    "lying": lying,
    "many": lambda: zipped({str(i): b"" for i in range(5000)}),
}


@pytest.mark.parametrize("name", BOMBS)
def test_bombs_do_not_go_off(name: str) -> None:
    data = BOMBS[name]()
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            decode(data, {"": 65535})
        assert tracemalloc.get_traced_memory()[1] < 1 << 28
    finally:
        tracemalloc.stop()


@given(data=st.data())
@settings(deadline=None, max_examples=200)
def test_whatever_a_signed_tile_holds_it_is_read_or_refused(whole: Path, data: st.DataObject) -> None:
    raw = bytearray(first_tile(MapStore(whole))[1].read_bytes())
    kind = data.draw(st.sampled_from(["bytes", "cut", "array"]))
    if kind == "bytes":
        for _ in range(data.draw(st.integers(1, 8))):
            raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    elif kind == "cut":
        a, b = sorted(data.draw(st.tuples(*[st.integers(0, len(raw))] * 2)))
        del raw[a:b]
    else:
        arrays = unpacked(bytes(raw))
        name = data.draw(st.sampled_from(sorted(arrays)))
        dtype = data.draw(
            st.sampled_from(["<i8", "<u2", "<u4", "<f8", ">i8", "<U3", "?", "S2", "<c16", "M8[s]", "V4"])
        )
        shape = data.draw(st.sampled_from([(), (0,), (1,), (40,), (40, 3), (3, 0), arrays[name].shape]))
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        arrays[name] = np.frombuffer(data.draw(st.binary(min_size=size, max_size=size)), dtype).reshape(shape)
        raw = bytearray(packed(arrays))
    try:
        decode(bytes(raw), {"": 3, "free.": 2})
    except InputError:
        return
