"""Maps in memory saved to stores, and stored maps fused: as `semgp.maps.fusion.fuse` does it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semgp.blocks.arrays import F64
from semgp.classes import Classes
from semgp.errors import InputError
from semgp.gp.model import GPModel
from semgp.maps.fusion import fuse
from semgp.maps.gp import GPSemanticMap
from semgp.store import MapStore, Settings, StoredMap, fuse_stored, save
from tests.store.scenes import (
    FORGETTING,
    FREE,
    MODEL,
    PLAIN,
    assert_same,
    cloud,
    in_memory,
    places,
    stored,
    uncertain,
)


def moved(x: float = 0.0, y: float = 0.0, degrees: float = 0.0) -> F64:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    T = np.eye(4)
    T[:2, :2], T[:2, 3] = [[c, -s], [s, c]], (x, y)
    return T


TRANSFORMS = {
    "one frame": None,
    "whole voxels": moved(2.56, -0.4),
    "a tile": moved(5.12),
    "part of a voxel": moved(0.013),
    "turned": moved(1.0, 2.0, 30.0),
    "far": moved(500.0),
}


@pytest.mark.parametrize("settings", [PLAIN, FREE, FORGETTING])
@pytest.mark.parametrize("cells", [4, 16])
def test_saved_maps_are_the_same(settings: Settings, cells: int, tmp_path: Path) -> None:
    made = in_memory(settings, cloud(0), uncertain(1, 5.0), cloud(2, 9.0))
    before = made.query(places(1))
    manifest = save(made, tmp_path / "map", cells=cells, note="a room")
    assert (manifest.number, manifest.note, manifest.settings.tiling.cells) == (1, "a room", cells)
    again = StoredMap(tmp_path / "map")
    assert_same(again.query(places(1)), before)
    assert_same(again.load().query(places(1)), before)
    again.update(cloud(3, 2.0))
    made.update(cloud(3, 2.0))
    assert_same(again.query(places(1)), made.query(places(1)))
    again.commit()
    assert_same(StoredMap(tmp_path / "map").query(places(1)), made.query(places(1)))


def test_an_empty_map_is_saved_and_goes_on(tmp_path: Path) -> None:
    save(GPSemanticMap(PLAIN.classes, MODEL), tmp_path / "map")
    with StoredMap(tmp_path / "map") as again:
        again.update(cloud(0))
    assert_same(again.query(places(1)), in_memory(PLAIN, cloud(0)).query(places(1)))


def test_what_cannot_be_saved(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no tiles"):
        save(GPSemanticMap(PLAIN.classes, GPModel()), tmp_path / "paper")
    assert not (tmp_path / "paper").exists()
    with pytest.raises(InputError, match="4, 8, 16 or 32"):
        save(in_memory(PLAIN, cloud(0)), tmp_path / "cells", cells=5)
    assert not (tmp_path / "cells").exists()
    stored(tmp_path / "map", cloud(0))
    with pytest.raises(InputError, match="holds a map already"):
        save(in_memory(PLAIN, cloud(1)), tmp_path / "map")
    assert MapStore(tmp_path / "map").numbers() == [1, 2]


@pytest.mark.parametrize("settings", [PLAIN, FREE])
@pytest.mark.parametrize("name", TRANSFORMS)
def test_stored_maps_fuse_as_maps_in_memory(name: str, settings: Settings, tmp_path: Path) -> None:
    mine = [cloud(0), uncertain(1, 3.0)], [cloud(2, 2.0), cloud(3, 6.0)]
    a, b = (stored(tmp_path / n, *clouds, settings=settings, most_sites=100) for n, clouds in zip("ab", mine))
    T = TRANSFORMS[name]
    manifest = fuse_stored(a, b, tmp_path / "both", T, note="both")
    wanted = fuse(in_memory(settings, *mine[0]), in_memory(settings, *mine[1]), T)
    made = StoredMap(tmp_path / "both")
    assert len(made) == manifest.sites == len(wanted)
    assert (manifest.clouds, manifest.note) == (4, "both")
    for X in (places(1), places(2) + ([0, 0, 0] if T is None else T[:3, 3])):
        assert_same(made.query(X), wanted.query(X))
    assert list(made.store.check()) == []
    listed = {t.name(k) for n in made.store.numbers() for k, t in made.store.manifest(n).tiles.items()}
    assert {p.name for p in (tmp_path / "both" / "tiles").iterdir()} == listed
    assert a.store.numbers() == b.store.numbers() == [1, 2]
    made.update(cloud(7, 3.0))
    wanted.update(cloud(7, 3.0))
    assert_same(made.query(places(1)), wanted.query(places(1)))


def test_maps_that_began_far_from_each_other(tmp_path: Path) -> None:
    a, b = stored(tmp_path / "a", cloud(0, 700.0)), stored(tmp_path / "b", cloud(1), cloud(2, 700.0))
    assert a.store.manifest().origin != b.store.manifest().origin
    fuse_stored(a, b, tmp_path / "both")
    wanted = fuse(in_memory(PLAIN, cloud(0, 700.0)), in_memory(PLAIN, cloud(1), cloud(2, 700.0)))
    made = StoredMap(tmp_path / "both")
    for shift in (0.0, 700.0):
        X = places(1) + np.array([shift, 0, 0])
        assert_same(made.query(X), wanted.query(X))


def test_an_empty_map_and_another(tmp_path: Path) -> None:
    a, b = stored(tmp_path / "a", settings=FREE), stored(tmp_path / "b", cloud(1), settings=FREE)
    for n, pair in (("ab", (a, b)), ("ba", (b, a))):
        fuse_stored(*pair, tmp_path / n)
        assert_same(StoredMap(tmp_path / n).query(places(1)), in_memory(FREE, cloud(1)).query(places(1)))
    assert fuse_stored(a, a, tmp_path / "aa").sites == 0


def test_free_space_is_kept_where_both_keep_it(tmp_path: Path) -> None:
    a, b = stored(tmp_path / "a", cloud(0), settings=FREE), stored(tmp_path / "b", cloud(1))
    for n, pair in (("ab", (a, b)), ("ba", (b, a))):
        fuse_stored(*pair, tmp_path / n)
        made = StoredMap(tmp_path / n)
        assert made.free is None
        assert_same(made.query(places(1)), in_memory(PLAIN, cloud(0), cloud(1)).query(places(1)))


def test_what_cannot_be_fused(tmp_path: Path) -> None:
    a = stored(tmp_path / "a", cloud(0))
    others = {
        "models differ": replace(PLAIN, model=replace(MODEL, leaf=32)),
        "classes differ": replace(PLAIN, classes=Classes(("floor", "wall", "sky"))),
        "forgets": FORGETTING,
    }
    for i, (message, settings) in enumerate(others.items()):
        b = stored(tmp_path / f"b{i}", settings=settings)
        with pytest.raises(InputError, match=message):
            fuse_stored(a, b, tmp_path / "out")
    with pytest.raises(InputError, match="T_a_b"):
        fuse_stored(a, a, tmp_path / "out", np.ones((4, 4)))
    with pytest.raises(InputError, match="holds a map already"):
        fuse_stored(a, a, tmp_path / "a")
    assert not (tmp_path / "out").exists()
    assert a.store.numbers() == [1, 2]


def test_maps_too_far_apart_leave_no_map(tmp_path: Path) -> None:
    a, b = stored(tmp_path / "a", cloud(0)), stored(tmp_path / "b", cloud(1))
    with pytest.raises(InputError, match="too far apart"):
        fuse_stored(a, b, tmp_path / "out", moved(1e6))
    assert MapStore(tmp_path / "out").numbers() == []
