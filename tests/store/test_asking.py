"""Stored maps asked piece by piece: the answers of the map that is asked at once."""

from pathlib import Path

import numpy as np
import pytest

from semgp.cli import main
from semgp.errors import FileFormatError, InputError
from semgp.executors import Threads
from semgp.maps.files import save_map
from semgp.readers import read
from semgp.store import MapStore, Settings, asking
from semgp.store.groups import groups
from semgp.writers import write_npz
from tests.store import scenes
from tests.store.scenes import assert_same, cloud, places, stored

ROUNDING = 2e-6


@pytest.fixture(autouse=True)
def _small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asking, "PIECE_SITES", 700)
    monkeypatch.setattr(asking, "PIECE_POINTS", 150)


@pytest.mark.parametrize("settings", [scenes.PLAIN, scenes.FREE], ids=["labels", "free space"])
def test_answers_are_those_of_the_whole_map(tmp_path: Path, settings: Settings) -> None:
    whole = stored(tmp_path / "map", *(cloud(i, 3.0 * i) for i in range(5)), settings=settings)
    X = places(7, 2000)
    done: list[int] = []
    answer = asking.query(whole.store, X, Threads(2), steps=done.append)
    assert len(done) > 5
    expected = whole.query(X)
    assert_same(answer, expected, ROUNDING)
    np.testing.assert_array_equal(answer.observed, expected.observed)


def test_each_row_is_asked_once_and_pieces_are_small(tmp_path: Path) -> None:
    manifest = stored(tmp_path / "map", *(cloud(i, 3.0 * i) for i in range(5))).store.manifest()
    X = np.vstack([places(3, 1000), np.full((400, 3), 1.5)])
    sizes = {key: tile.sites for key, tile in manifest.tiles.items()}
    origin = np.array(manifest.origin, dtype=np.int64)
    pieces = list(groups(X, manifest.settings, origin, sizes, 700, 150))
    np.testing.assert_array_equal(np.sort(np.concatenate([rows for rows, _ in pieces])), np.arange(len(X)))
    assert all(len(rows) <= 150 for rows, _ in pieces)
    assert all(set(tiles.tolist()) & set(sizes) < set(sizes) for _, tiles in pieces)
    together = [sum(sizes.get(tile, 0) for tile in tiles.tolist()) for _, tiles in pieces]
    alone = [len(np.unique(manifest.settings.tiling.of_points(X[rows], 0.02, origin))) == 1 for rows, _ in pieces]
    assert all(n <= 700 or one for n, one in zip(together, alone))


def test_an_older_version_is_asked(tmp_path: Path) -> None:
    whole = stored(tmp_path / "map", cloud(0))
    before = whole.query(places(0))
    whole.update(cloud(1))
    version = whole.version
    whole.commit()
    assert_same(asking.query(whole.store, places(0), Threads(1), version=version), before, ROUNDING)


def test_points_far_from_the_map_and_none_at_all(tmp_path: Path) -> None:
    whole = stored(tmp_path / "map", cloud(0))
    for X in (np.array([[5e3, 0, 0], [1.0, 1.0, 0.0], [0, 9e9, 0]]), np.empty((0, 3))):
        answer = asking.query(whole.store, X, Threads(2))
        assert_same(answer, whole.query(X), ROUNDING)


def test_bad_input(tmp_path: Path) -> None:
    store = MapStore(tmp_path / "map")
    store.create(scenes.PLAIN)
    with pytest.raises(InputError, match="no labelled points"):
        asking.query(store, places(0), Threads(1))
    whole = stored(tmp_path / "other", cloud(0))
    with pytest.raises(InputError, match="finite"):
        asking.query(whole.store, [[np.nan, 0, 0]], Threads(1))
    with pytest.raises(InputError, match="features"):
        asking.query(whole.store, places(0), Threads(1), features=np.zeros((3, 1)))
    with pytest.raises(InputError, match="features"):
        asking.query(whole.store, places(0), Threads(1), features=np.zeros((400, 1)))
    key, tile = next(iter(whole.store.manifest().tiles.items()))
    (tmp_path / "other" / "tiles" / tile.name(key)).write_bytes(b"no tile")
    with pytest.raises(FileFormatError, match="damaged"):
        asking.query(whole.store, places(0), Threads(1))


def test_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = stored(tmp_path / "map", *(cloud(i, 3.0 * i) for i in range(3)))
    write_npz(tmp_path / "points.npz", cloud(5, 2.0))
    for name, more in (("a.npz", []), ("b.npz", ["--workers", "2"])):
        command = ["query", tmp_path / "map", "--points", tmp_path / "points.npz", "--out", tmp_path / name, *more]
        with pytest.raises(SystemExit) as end:
            main([str(word) for word in command])
        assert not end.value.code
    a, b = (read(tmp_path / name) for name in ("a.npz", "b.npz"))
    assert len(a) == 300
    assert a.weights is not None
    assert b.weights is not None
    np.testing.assert_allclose(a.weights, b.weights, atol=ROUNDING)
    save_map(whole.load(), tmp_path / "file.semgp")
    with pytest.raises(SystemExit):
        main(["query", str(tmp_path / "file.semgp"), "--points", str(tmp_path / "points.npz"),
              "--out", str(tmp_path / "c.npz"), "--workers", "2"])  # fmt: skip
    assert "are for stores" in capsys.readouterr().err
