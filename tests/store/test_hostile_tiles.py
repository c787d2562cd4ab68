"""Damaged and hostile tiles: an error that names the file, and what is whole stays usable."""

import os
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semgp.errors import FileFormatError, InputError
from semgp.maps.tiles import Arrays
from semgp.store import MapStore, StoredMap
from semgp.store.tile_files import encode
from tests.store.hostile import CLOUDS, FEW, assert_refused, failure, first_tile, packed, unpacked, use
from tests.store.scenes import (
    FORGETTING,
    assert_same,
    in_memory,
    places,
    publish,
    replace_tile,
)


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
