"""2-D grids for navigation: occupancy as `nav_msgs/OccupancyGrid` has it, and costs by class."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING, Classes
from semgp.errors import InputError
from semgp.maps.protocol import BATCH, SpatialMap, occupancy_of
from semgp.maps.settings import require_positive
from semgp.parallel import slices
from semgp.planning.boxes import box_corners, cells_between, require_few
from semgp.prediction import OCCUPIED, UNKNOWN
from semgp.upward import level
from semgp.writers import atomic_write

LETHAL = 100
"""Cost of what must not be driven over or into."""

_OCCUPIED_PERCENT, _FREE_PERCENT = 65.0, 19.6  # map_server's thresholds; 205 / 255 is just not free
_BLACK, _GREY, _WHITE = 0, 205, 254


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A grid seen from above: row 0 is that of the lowest y, column 0 that of the lowest x.

    Parameters
    ----------
    data : (rows, columns) int8 array
        Greatest probability that something is there, in percent, over those sampled heights that are known; -1
        where none is. `data.ravel()` is the `data` of a `nav_msgs/OccupancyGrid`.
    label : (rows, columns) int32 array
        Class of the topmost height that is occupied, with a probability of one half or more; `MISSING` where
        none is, or where the map has no label for it.
    origin : (2,) array
        x and y in metres of the lower left corner of the grid.
    resolution : float
        Edge of a cell in metres.
    costs : (rows, columns) int8 array, optional
        Greatest cost over the heights that are occupied; 0 where none is; -1 where all are unknown. None where no
        costs were given.
    """

    data: NDArray[np.int8]
    label: NDArray[np.int32]
    origin: NDArray[np.float64]
    resolution: float
    costs: NDArray[np.int8] | None = None

    def write(self, path: str | Path) -> None:
        """Write the grid for map_server: a YAML file and, beside it, its image `<stem>.pgm`.

        Both are written whole before the one and then the other takes its place.
        The image is trinary, its top row that of the highest y: black is occupied, white free, grey unknown. Of
        `data`, 65 % or more is occupied, less than 19.6 % free, and what lies between unknown. A grid with costs
        is written by them: black where lethal, white where traversable at whatever cost.

        Parameters
        ----------
        path : str or Path
            Where the YAML file is to be: `*.yaml`.

        Raises
        ------
        InputError
            Another suffix, or a folder that does not exist.
        """
        path = Path(path)
        if path.suffix != ".yaml":
            raise InputError(f"cannot write {path}: map_server's maps are called *.yaml.")
        x, y, edge = (np.format_float_positional(v, 9, trim="0") for v in (*self.origin, self.resolution))
        text = (
            f"image: {json.dumps(path.with_suffix('.pgm').name)}\nmode: trinary\nresolution: {edge}\n"
            f"origin: [{x}, {y}, 0.0]\nnegate: 0\n"
            f"occupied_thresh: {_OCCUPIED_PERCENT / 100}\nfree_thresh: {_FREE_PERCENT / 100}\n"
        )
        rows, columns = self.data.shape
        with atomic_write(path) as settings, atomic_write(path.with_suffix(".pgm")) as image:
            image.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + self._image()[::-1].tobytes())
            settings.write_text(text, encoding="utf-8")

    def _image(self) -> NDArray[np.uint8]:
        if self.costs is None:
            known, occupied, free = self.data >= 0, self.data >= _OCCUPIED_PERCENT, self.data < _FREE_PERCENT
        else:
            known, occupied, free = self.costs >= 0, self.costs == LETHAL, self.costs < LETHAL
        return np.where(known & occupied, _BLACK, np.where(known & free, _WHITE, _GREY)).astype(np.uint8)


def occupancy_grid(
    semantic_map: SpatialMap,
    low: ArrayLike,
    high: ArrayLike,
    *,
    heights: tuple[float, float],
    resolution: float,
    costs: Mapping[str, float] | None = None,
) -> OccupancyGrid:
    """Return a grid of what stands between two heights.

    Without costs, whatever is occupied is an obstacle, ground too: begin the heights above it. With costs, the
    heights may begin below the ground: each occupied height costs what its most probable class costs, 100 (lethal)
    for classes that are not named and for what was never labelled, and a column costs what its most expensive
    height costs. So a ground class with a cost below 100 is traversable, and an obstacle on it is not. Where the
    ground was never seen, what is free above it costs nothing: a drop is not told from a floor out of sight.

    Parameters
    ----------
    semantic_map : SpatialMap
        A map that keeps free space; asked at the middle of each cell and height. Where its world has another axis
        upwards than z, corners and heights are those of the level frame (`semgp.upward.level`).
    low, high : (2,) arrays
        Corners of the grid, x and y in metres, world frame.
    heights : (float, float)
        Lowest and highest z in metres; sampled in the middle of layers not thicker than the resolution.
    resolution : float
        Edge of a cell in metres.
    costs : mapping of str to number, optional
        Cost of classes by name, 0 (free) to 100 (lethal), such as ``{"road": 0, "sidewalk": 30}``.

    Raises
    ------
    InputError
        Corners or heights that are not finite or not in order, a resolution that is not positive, a box of more
        than 16,777,216 cells, costs out of range or of unknown classes, or a map that keeps no free space.
    """
    edge = require_positive("resolution", resolution)
    a, b = box_corners(low, high, 2)
    cells = cells_between(a[::-1], b[::-1], edge)
    levels = _levels(heights, edge)
    require_few(float(len(cells)) * len(levels), edge)
    price = _prices(costs or {}, semantic_map.classes)
    R = level(semantic_map.up)
    data, cost = np.full(len(cells), -1, dtype=np.int8), np.full(len(cells), -1, dtype=np.int8)
    label = np.full(len(cells), MISSING, dtype=np.int32)
    for part in slices(len(cells), BATCH):
        centres = cells.centres(np.arange(part.start, part.stop))[:, ::-1]
        for height in levels:
            prediction = semantic_map.query(np.insert(centres, 2, height, axis=1) @ R)
            occupancy = occupancy_of(prediction)
            state = occupancy.state
            percent = np.where(state == UNKNOWN, -1, np.rint(100 * occupancy.probability)).astype(np.int8)
            here = np.where(state == OCCUPIED, price[prediction.label], np.where(state == UNKNOWN, -1, 0))
            data[part] = np.maximum(data[part], percent)
            label[part] = np.where(state == OCCUPIED, prediction.label, label[part])
            cost[part] = np.maximum(cost[part], here)
    layer = None if costs is None else cost.reshape(cells.shape)
    return OccupancyGrid(data.reshape(cells.shape), label.reshape(cells.shape), a, edge, layer)


def _levels(heights: tuple[float, float], resolution: float) -> NDArray[np.float64]:
    """Return the heights to look at."""
    try:
        low, high = (float(z) for z in heights)
    except (TypeError, ValueError) as error:
        raise InputError(f"heights must be two numbers, lowest and highest z, not {heights!r}.") from error
    if not (np.isfinite([low, high]).all() and low <= high):
        raise InputError(f"heights must be two finite numbers, the lowest first, not {low} and {high}.")
    n = max(1.0, np.ceil((high - low) / resolution - 1e-9))
    require_few(float(n), resolution)
    return np.asarray(low + (np.arange(int(n)) + 0.5) * (high - low) / n)


def _prices(costs: Mapping[str, float], classes: Classes) -> NDArray[np.int8]:
    """Return the cost (C + 1,) of each class, and at the end, where `MISSING` looks, that of no label."""
    price = np.full(len(classes) + 1, LETHAL, dtype=np.int8)
    for name, cost in costs.items():
        if not (isinstance(cost, int | float | np.number) and 0 <= cost <= LETHAL):
            raise InputError(f"the cost of {name} must be a number from 0 to {LETHAL}, not {cost!r}.")
        price[classes.index(name)] = round(cost)
    return price
