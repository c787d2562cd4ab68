"""Dense grids: what Zarr reads back is what the map answers."""

import sys
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from semgp.errors import InputError, MissingExtraError
from semgp.maps.gp import GPSemanticMap
from semgp.maps.grid import CHUNK, write_grid
from semgp.maps.protocol import SemanticMap
from semgp.octomap import SemanticOctoMap
from semgp.store import StoredMap
from tests.store.scenes import CLASSES, FREE, MODEL, PLAIN, cloud, in_memory, stored

zarr = pytest.importorskip("zarr", reason="grids need the extra zarr")


def octomap() -> SemanticOctoMap:
    made = SemanticOctoMap(CLASSES, resolution=0.1)
    made.update(cloud(0))
    return made


def of(kind: str, folder: Path) -> SemanticMap:
    if kind == "octomap":
        return octomap()
    settings = PLAIN if kind == "plain" else FREE
    if kind == "stored":
        return stored(folder / "map", cloud(0), cloud(1, 4.0), settings=settings, most_sites=100)
    return in_memory(settings, cloud(0), cloud(1, 4.0))


@pytest.mark.parametrize("kind", ["plain", "free", "stored", "octomap"])
def test_the_grid_holds_the_maps_answers(kind: str, tmp_path: Path) -> None:
    made, seen = of(kind, tmp_path), []
    shape = write_grid(made, tmp_path / "grid.zarr", 0.09, lambda done, total: seen.append((done, total)))
    assert seen == [(i + 1, len(seen)) for i in range(len(seen))]
    group = zarr.open_group(tmp_path / "grid.zarr", mode="r")
    low = np.array(group.attrs["low"])
    assert group.attrs["resolution"] == 0.09
    assert group.attrs["classes"] == list(CLASSES.names)
    assert group.attrs["colours"] == [list(colour) for colour in CLASSES.colours]
    label = group["label"][:]
    assert label.shape == shape
    assert label.dtype == np.int16
    assert group["label"].metadata.dimension_names == ("x", "y", "z")
    probability = group["probability"][:]
    assert probability.shape == (*shape, 3)
    stored_at = np.argwhere(np.isfinite(probability[..., 0]))
    rows = stored_at[np.random.default_rng(0).permutation(len(stored_at))[:500]]
    answer = made.query(low + (rows + 0.5) * 0.09)
    at = tuple(rows.T)
    np.testing.assert_array_equal(label[at], answer.label)
    np.testing.assert_array_equal(group["observed"][:][at], answer.observed)
    np.testing.assert_allclose(probability[at], answer.probability, atol=1e-5)
    if answer.variance is not None:
        best = answer.variance[np.arange(len(rows)), answer.probability.argmax(axis=1)]
        np.testing.assert_allclose(group["variance"][:][at], best, atol=1e-5)
    assert ("occupancy" in group) == (answer.occupancy is not None) == ("known" in group)
    if answer.occupancy is not None:
        np.testing.assert_allclose(group["occupancy"][:][at], answer.occupancy.probability, atol=1e-5)
        np.testing.assert_array_equal(group["known"][:][at], answer.occupancy.known)


def test_all_data_lie_in_the_grid_and_what_lies_beyond_is_empty(tmp_path: Path) -> None:
    made = in_memory(PLAIN, cloud(0), cloud(1, 30.0))
    shape = write_grid(made, tmp_path / "grid.zarr", 0.1)
    group = zarr.open_group(tmp_path / "grid.zarr", mode="r")
    voxel = np.floor(made.positions / 0.1).astype(int) - np.rint(np.array(group.attrs["low"]) / 0.1).astype(int)
    assert (voxel >= 1).all()
    assert (voxel < np.array(shape) - 1).all()
    assert np.isfinite(group["probability"][:][tuple(voxel.T)]).all()
    label = group["label"][:]
    middle = int(15 / 0.1) // CHUNK * CHUNK  # a chunk far from both clouds
    assert (label[middle : middle + CHUNK] == -1).all()
    assert np.isnan(group["probability"][:][middle : middle + CHUNK]).all()
    assert not group["observed"][:][middle : middle + CHUNK].any()
    assert (label[tuple(voxel.T)] >= 0).mean() > 0.9


def test_negative_and_large_coordinates(tmp_path: Path) -> None:
    shift = np.array([-4.5e6, 5.4e6, -30.0])
    made = in_memory(PLAIN, replace(cloud(0), points=cloud(0).points + shift, T_world_sensor=None))
    write_grid(made, tmp_path / "grid.zarr", 0.1)
    group = zarr.open_group(tmp_path / "grid.zarr", mode="r")
    np.testing.assert_allclose(group.attrs["low"], made.positions.min(axis=0), atol=0.21)


@pytest.mark.parametrize("resolution", [0.0, -1.0, np.nan, np.inf, 1e-300])
def test_resolutions_that_are_none(resolution: float, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"resolution|too large"):
        write_grid(in_memory(PLAIN, cloud(0)), tmp_path / "grid.zarr", resolution)
    assert list(tmp_path.iterdir()) == []


def test_refusals_leave_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="empty"):
        write_grid(GPSemanticMap(CLASSES, MODEL), tmp_path / "grid.zarr", 0.1)
    with pytest.raises(InputError, match="too large: crop"):
        write_grid(in_memory(PLAIN, cloud(0), cloud(1, 15_000.0)), tmp_path / "grid.zarr", 1e-3)
    with mock.patch.dict(sys.modules, {"zarr": None}), pytest.raises(MissingExtraError, match=r"semgp\[zarr\]"):
        write_grid(in_memory(PLAIN, cloud(0)), tmp_path / "grid.zarr", 0.1)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "grid.zarr").write_text("somebody's own")
    with pytest.raises(InputError, match="there already"):
        write_grid(in_memory(PLAIN, cloud(0)), tmp_path / "grid.zarr", 0.1)
    assert (tmp_path / "grid.zarr").read_text() == "somebody's own"


def test_an_export_that_breaks_off_leaves_nothing(tmp_path: Path) -> None:
    made = stored(tmp_path / "map", cloud(0), cloud(1, 4.0), most_sites=1)

    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_grid(made, tmp_path / "grid.zarr", 0.1, stop)
    assert {p.name for p in tmp_path.iterdir()} == {"map"}


def test_a_damaged_tile_stops_the_export(tmp_path: Path) -> None:
    stored(tmp_path / "map", cloud(0))
    path = sorted((tmp_path / "map" / "tiles").iterdir())[0]
    path.write_bytes(b"damaged")
    with pytest.raises(InputError, match=path.name):
        write_grid(StoredMap(tmp_path / "map"), tmp_path / "grid.zarr", 0.1)
    assert {p.name for p in tmp_path.iterdir()} == {"map"}
