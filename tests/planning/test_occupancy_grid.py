"""Occupancy grids against loops over columns, and their files as map_server reads them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from semgp.baselines.knn import KNNMap
from semgp.classes import MISSING
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.planning import OccupancyGrid, occupancy_grid
from tests.planning import naive
from tests.planning.box_world import FLOOR, TABLE, WALL, room

LOW, HIGH = (-0.5, -0.2), (4.2, 3.1)
COSTS = {"floor": 7, "table": 40}


def test_cells_are_those_of_the_loop() -> None:
    world = room(softness=0.1)
    world.boxes[0, 1] = 1.0  # a part without a floor
    grid = occupancy_grid(world, LOW, HIGH, heights=(-0.3, 0.9), resolution=0.31, costs=COSTS)
    assert grid.costs is not None
    assert grid.data.shape == grid.label.shape == grid.costs.shape == (11, 16)
    assert grid.data.dtype == grid.costs.dtype == np.int8
    assert grid.label.dtype == np.int32
    heights = [-0.15, 0.15, 0.45, 0.75]
    for row in range(11):
        for column in range(16):
            x, y = LOW[0] + (column + 0.5) * 0.31, LOW[1] + (row + 0.5) * 0.31
            cell = grid.data[row, column], grid.label[row, column], grid.costs[row, column]
            assert cell == naive.grid_cell(world, x, y, heights, COSTS)
    assert set(grid.costs.ravel().tolist()) == {-1, 0, 7, 40, 100}
    assert len(np.unique(grid.data)) > 6


def test_what_lies_on_the_ground_is_traversable_and_what_stands_on_it_is_not() -> None:
    grid = occupancy_grid(room(), (0, 0), (4, 3), heights=(-0.1, 1.0), resolution=0.1, costs={"floor": 0})
    costs = grid.costs
    assert costs is not None
    assert (costs[:, 32:] == -1).all()
    assert (costs[10:20, 15:25] == 100).all()
    assert (costs[:, :15] == 0).all()
    assert (grid.label[10:20, 15:25] == TABLE).all()
    assert (grid.label[:, :15] == FLOOR).all()
    assert (grid.data[:, :32] >= 99).all()


def test_heights_above_the_ground_need_no_costs() -> None:
    grid = occupancy_grid(room(), (-0.1, 0), (3, 3), heights=(0.1, 0.5), resolution=0.1)
    assert grid.costs is None
    assert (grid.data[:, 0] >= 99).all()
    assert (grid.label[:, 0] == WALL).all()
    assert (grid.data[14:16, 20:22] >= 99).all()  # the table's leg, and nothing of its top
    assert (grid.data[:, 1:] > 50).sum() == 4
    assert grid.label[15, 10] == MISSING
    one = occupancy_grid(room(), (0, 0), (3, 3), heights=(0.7, 0.7), resolution=0.1)
    assert (one.data > 50).sum() == 100


def test_row_zero_is_the_lowest_y_and_ravel_is_the_message() -> None:
    grid = occupancy_grid(room(), (0, -0.2), (3, 1), heights=(0.5, 0.6), resolution=0.2)
    assert (grid.data[0] == 100).all()
    assert (grid.data[1] < 50).all()
    np.testing.assert_array_equal(grid.data.ravel()[:15], 100)
    assert grid.origin.tolist() == [0, -0.2]
    assert grid.resolution == 0.2


def served(path: Path) -> tuple[dict[str, Any], NDArray[np.int8]]:
    """Read a map as map_server does, in its trinary mode: settings, and data from the lowest row up."""
    lines = dict(line.split(": ") for line in path.read_text().splitlines())
    settings: dict[str, Any] = {
        key: json.loads(value) if value[0] in '["' else value if key == "mode" else float(value)
        for key, value in lines.items()
    }
    pixels = np.asarray(Image.open(path.parent / settings["image"]), dtype=np.float64)
    darkness = (255 - pixels) / 255
    free = np.where(darkness < settings["free_thresh"], 0, -1)
    data = np.where(darkness > settings["occupied_thresh"], 100, free)
    return settings, data[::-1].astype(np.int8)


def test_the_written_map_is_read_back(tmp_path: Path) -> None:
    data = np.array([[-1, 0, 19, 20], [64, 65, 100, 0]], dtype=np.int8)
    grid = OccupancyGrid(data, np.zeros((2, 4), np.int32), np.array([1e-17 - 5.5, 5e6]), 0.05)
    grid.write(tmp_path / "a map.yaml")
    settings, read = served(tmp_path / "a map.yaml")
    assert read.tolist() == [[-1, 0, 0, -1], [-1, 100, 100, 0]]
    assert settings["origin"] == [-5.5, 5e6, 0]
    assert settings["resolution"] == 0.05
    assert settings["negate"] == 0
    assert settings["mode"] == "trinary"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a map.pgm", "a map.yaml"]


def test_costs_are_written_where_there_are_any(tmp_path: Path) -> None:
    costs = np.array([[-1, 0, 30, 99, 100]], dtype=np.int8)
    grid = OccupancyGrid(np.full((1, 5), 100, np.int8), np.zeros((1, 5), np.int32), np.zeros(2), 0.1, costs)
    grid.write(tmp_path / "map.yaml")
    assert served(tmp_path / "map.yaml")[1].tolist() == [[-1, 0, 0, 0, 100]]


def test_nothing_is_written_where_it_cannot_be(tmp_path: Path) -> None:
    grid = OccupancyGrid(np.zeros((1, 1), np.int8), np.zeros((1, 1), np.int32), np.zeros(2), 0.1)
    with pytest.raises(InputError, match=r"\.yaml"):
        grid.write(tmp_path / "map.png")
    with pytest.raises(InputError, match="does not exist"):
        grid.write(tmp_path / "nowhere" / "map.yaml")
    (tmp_path / "map.pgm").mkdir()
    with pytest.raises(InputError, match=r"map\.pgm: Is a directory"):
        grid.write(tmp_path / "map.yaml")
    assert [p.name for p in tmp_path.iterdir()] == ["map.pgm"]


@pytest.mark.parametrize(
    ("low", "high", "settings", "complaint"),
    [
        ((1, 1), (0, 2), {}, "low below high"),
        ((0, 0, 0), (1, 1, 1), {}, "2 finite numbers"),
        (0.0, 1.0, {}, "2 finite numbers"),
        ((0, 0), (1, np.nan), {}, "2 finite numbers"),
        ((0, 0), (1, 1), {"heights": (1, 0)}, "lowest first"),
        ((0, 0), (1, 1), {"heights": (0, np.nan)}, "lowest first"),
        ((0, 0), (1, 1), {"heights": 1.0}, "heights must be two numbers"),
        ((0, 0), (1, 1), {"heights": (0, 1e300)}, "more than 16,777,216"),
        ((0, 0), (100, 100), {"heights": (0, 20)}, "more than 16,777,216"),
        ((0, 0), (1e6, 1e6), {}, "more than 16,777,216"),
        ((0, 0), (1, 1), {"resolution": np.nan}, "resolution must be"),
        ((0, 0), (1, 1), {"costs": {"lava": 100}}, "no class is called 'lava'"),
        ((0, 0), (1, 1), {"costs": {"floor": 101}}, "cost of floor"),
        ((0, 0), (1, 1), {"costs": {"floor": "low"}}, "cost of floor"),
    ],
)
def test_bad_input(low: ArrayLike, high: ArrayLike, settings: dict[str, Any], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        occupancy_grid(room(), low, high, **{"heights": (0.0, 1.0), "resolution": 0.1, **settings})


def test_a_map_without_free_space(corner: LabelledCloud) -> None:
    flat = KNNMap(corner.classes)
    flat.update(corner)
    with pytest.raises(InputError, match=r"free=FreeSpace\(\)"):
        occupancy_grid(flat, (0, 0), (1, 1), heights=(0, 1), resolution=0.1)  # type: ignore[arg-type]
