"""Stored maps give the answers of maps in memory, to the last bit, however they are written, cut up and loaded."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.executors import Threads
from semgp.maps.files import load_map
from semgp.maps.tiles import Tiling
from semgp.store import MapStore, Settings, StoredMap, build
from tests.store.scenes import (
    CLASSES,
    FORGETTING,
    FREE,
    MODEL,
    PLAIN,
    STREET,
    assert_same,
    in_memory,
    places,
    stored,
    uncertain,
)

NAMES = ("labels", "soft", "features", "uncertain", "mixed", "free", "forgetting", "experts", "other", "wide")


def scene(name: str) -> tuple[Settings, list[LabelledCloud]]:
    """Settings, and clouds that go with them."""
    rng = np.random.default_rng(7)
    if name == "soft":
        clouds = [replace(c, labels=None, weights=rng.dirichlet([1, 1, 1], len(c))) for c in STREET]
        return PLAIN, [replace(c, confidence=rng.uniform(0.1, 1, len(c)).astype(np.float32)) for c in clouds]
    if name == "features":
        model = replace(
            MODEL, kernel=replace(MODEL.terms[0], ell=(0.05, 0.05, 0.05, 0.4)), features=("intensity",)
        )
        return Settings(CLASSES, model), [
            replace(c, features=rng.uniform(size=(len(c), 1)), feature_names=("intensity",)) for c in STREET
        ]
    if name == "uncertain":
        return PLAIN, [uncertain(i, 3.0 * i) for i in range(5)]
    if name == "mixed":
        return PLAIN, [uncertain(i, 3.0 * i) if i % 2 else STREET[i] for i in range(5)]
    if name == "experts":
        return Settings(CLASSES, replace(MODEL, posterior="softmax", weights=None)), STREET
    if name == "other":
        return Settings(CLASSES, replace(MODEL, other=True)), STREET
    if name == "wide":
        return Settings(CLASSES, MODEL, tiling=Tiling(8)), STREET
    return {"labels": PLAIN, "free": FREE, "forgetting": FORGETTING}[name], STREET


def written(place: Path, settings: Settings, clouds: Sequence[LabelledCloud], most: int, every: int) -> StoredMap:
    """A map committed every so many clouds."""
    with StoredMap.create(place, settings, most_sites=most) as made:
        for i, one in enumerate(clouds, 1):
            made.update(one)
            if i % every == 0:
                made.commit()
    return made


@pytest.mark.parametrize("name", NAMES)
def test_answers_are_those_of_the_map_in_memory(name: str, tmp_path: Path) -> None:
    settings, clouds = scene(name)
    wanted = in_memory(settings, *clouds).query(places(1))
    made = written(tmp_path / "map", settings, clouds, 10**6, every=2)
    assert_same(made.query(places(1)), wanted)
    again = StoredMap(tmp_path / "map")
    assert_same(again.query(places(1)), wanted)
    assert_same(again.load().query(places(1)), wanted)
    assert len(again) == len(made) == len(in_memory(settings, *clouds))
    assert again.info()["tiles"] > 2


@pytest.mark.parametrize("name", NAMES)
def test_a_small_working_set_moves_last_bits_only(name: str, tmp_path: Path) -> None:
    settings, clouds = scene(name)
    wanted = in_memory(settings, *clouds).query(places(1))
    made = written(tmp_path / "map", settings, clouds, 150, every=5)
    assert_same(made.query(places(1)), wanted, 1e-5)
    whole = StoredMap(tmp_path / "map")
    assert_same(whole.query(places(1)), wanted)  # what went to files and back is the same
    assert_same(StoredMap(tmp_path / "map", most_sites=1).query(places(1)), wanted, 1e-5)
    assert made.info()["tiles_in_memory"] < whole.info()["tiles"]


@pytest.mark.parametrize("name", ["labels", "free", "mixed"])
def test_the_files_are_those_of_a_build_by_workers(name: str, tmp_path: Path) -> None:
    settings, clouds = scene(name)
    written(tmp_path / "a", settings, clouds, 10**6, every=5)
    written(tmp_path / "b", settings, clouds, 150, every=1)
    store = MapStore(tmp_path / "c")
    store.create(settings)
    build(store, clouds, Threads(2), batch=1)
    a, b, c = (MapStore(tmp_path / n).manifest() for n in "abc")
    assert a.clouds == b.clouds == c.clouds == 5
    assert a.tiles == b.tiles == c.tiles


def test_far_points_no_points_and_features_that_do_not_fit(tmp_path: Path) -> None:
    made = stored(tmp_path / "map", *STREET)
    far = made.query([[1e300, 0, -1e300], [5e6, 5e6, 0], [1e5, 0, 0]])
    assert_same(far, in_memory(PLAIN, *STREET).query([[1e300, 0, -1e300], [5e6, 5e6, 0], [1e5, 0, 0]]))
    assert not far.observed.any()
    assert made.query(np.empty((0, 3))).probability.shape == (0, 3)
    for points, features in (([[0, 0]], None), ([[0, 0, np.nan]], None), ([[0, 0, 0]], np.ones((1, 2)))):
        with pytest.raises(InputError):
            made.query(points, features)


def test_an_empty_map_has_no_answers(tmp_path: Path) -> None:
    made = StoredMap.create(tmp_path / "map", FREE)
    for act in (lambda: made.query([[0, 0, 0]]), lambda: made.occupancy([[0, 0, 0]])):
        with pytest.raises(InputError, match="no labelled points yet"):
            act()
    assert len(made) == 0
    assert made.positions.shape == made.occupied_positions.shape == (0, 3)
    assert made.origin is None
    assert len(made.load()) == len(made.crop((0, 0, 0), (1, 1, 1))) == 0
    with pytest.raises(InputError, match="holds a map already"):
        StoredMap.create(tmp_path / "map", FREE)
    with pytest.raises(InputError, match="holds no map"):
        StoredMap(tmp_path / "elsewhere")


def test_utm_coordinates_lose_nothing(tmp_path: Path) -> None:
    shift = np.array([4_500_000.0, 5_400_000.0, 300.0])
    clouds = [LabelledCloud(c.points + shift, CLASSES, c.labels) for c in STREET]
    made = stored(tmp_path / "map", *clouds, most_sites=200)
    wanted = in_memory(PLAIN, *clouds)
    assert_same(StoredMap(tmp_path / "map").query(places(1) + shift), wanted.query(places(1) + shift))
    assert_same(made.query(places(1) + shift), wanted.query(places(1) + shift), 1e-5)
    np.testing.assert_array_equal(sorted(made.positions.tolist()), sorted(wanted.positions.tolist()))


def test_points_on_the_borders_of_tiles(tmp_path: Path) -> None:
    edge = 256 * MODEL.resolution
    made = stored(tmp_path / "map", *STREET)
    keys = np.array(sorted(made.store.manifest().tiles), dtype=np.int64)
    x = np.concatenate([edge * i + np.array([-0.03, -1e-9, 0, 1e-9, 0.03]) for i in range(4)])
    points = np.stack(np.meshgrid(x, [0.0, 1.5, 2.9], [-0.01, 0, 0.01]), axis=-1).reshape(-1, 3)
    assert len(keys) >= 4
    assert_same(made.query(points), in_memory(PLAIN, *STREET).query(points))
    alone = StoredMap(tmp_path / "map", most_sites=1)
    for one in points[::7]:
        assert_same(alone.query(one[None]), in_memory(PLAIN, *STREET).query(one[None]), 1e-6)


def test_positions_box_and_numbers(tmp_path: Path) -> None:
    wanted = in_memory(FREE, *STREET)
    made = stored(tmp_path / "map", *STREET, settings=FREE, most_sites=300)

    def rows(X: np.ndarray) -> list[list[float]]:
        return sorted(X.tolist())

    assert rows(made.positions) == rows(wanted.positions)
    assert rows(made.occupied_positions) == rows(wanted.occupied_positions)
    assert rows(made.free_positions) == rows(wanted.free_positions)
    np.testing.assert_array_equal(made.occupancy(places(3)).known, wanted.occupancy(places(3)).known)
    cropped = made.crop((2, 0, -1), (7, 2, 1))
    assert_same(cropped.query(places(2)), wanted.crop((2, 0, -1), (7, 2, 1)).query(places(2)))
    assert len(made.crop((100, 0, 0), (101, 1, 1))) == 0
    with pytest.raises(InputError, match="corners"):
        made.crop((0, 0, 0), (0, 1, 1))
    info = made.info()
    assert (info["sites"], info["clouds"], info["version"]) == (len(wanted), 5, 2)
    assert info["bytes_on_disk"] == sum(p.stat().st_size for p in (tmp_path / "map" / "tiles").iterdir())
    assert made.resolution == wanted.resolution
    assert isinstance(load_map(tmp_path / "map"), StoredMap)


def test_a_crop_reads_only_the_tiles_in_the_box(tmp_path: Path) -> None:
    made = stored(tmp_path / "map", *STREET)
    for path in (tmp_path / "map" / "tiles").iterdir():
        if int(path.name[:16], 16) >> 42 > (1 << 20):  # beyond the first tile along x
            path.unlink()
    assert len(made.crop((0, 0, -1), (3, 3, 1))) == len(in_memory(PLAIN, *STREET).crop((0, 0, -1), (3, 3, 1)))
    with pytest.raises(FileFormatError, match="no such file"):
        made.crop((0, 0, -1), (9, 3, 1))
    assert made.query([[1, 1, 0]]).observed.all()  # what is asked elsewhere is not missed


def test_real_scans_in_less_memory_than_they_need(data_dir: Path, tmp_path: Path) -> None:
    from semgp.maps.presets import OUTDOOR_LIDAR
    from semgp.readers import open_scans

    clouds = [scan[::12] for scan in open_scans(data_dir / "semantickitti_08")[:3]]
    settings = Settings(clouds[0].classes, OUTDOOR_LIDAR)
    wanted = in_memory(settings, *clouds)
    made = written(tmp_path / "map", settings, clouds, len(wanted) // 3, every=1)
    X = clouds[1].points[::40]
    assert_same(StoredMap(tmp_path / "map").query(X), wanted.query(X))
    assert_same(made.query(X), wanted.query(X), 2e-5)
    sizes = [MapStore(tmp_path / "map").manifest(n).sites for n in (1, 2, 3, 4)]
    assert all(a < b for a, b in pairwise(sizes))
