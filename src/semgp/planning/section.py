"""Horizontal sections through a map, to look at: what is where at one height, and how sure the map is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING, Classes
from semgp.errors import InputError
from semgp.maps.protocol import BATCH, SemanticMap
from semgp.maps.settings import require_positive
from semgp.parallel import slices
from semgp.picture.compose import colour_bar, heading, legend, panels, stack
from semgp.picture.image import Picture
from semgp.picture.paint import Bar, paint_labels, paint_values
from semgp.picture.portrait import with_scale_bar
from semgp.planning.boxes import box_corners, cells_between
from semgp.prediction import FREE, UNKNOWN, Prediction
from semgp.upward import level

_FREE_COLOUR = (240, 236, 222)
_PIXELS = 700
"""Least pixels from side to side of a picture."""


@dataclass(frozen=True, eq=False)
class Section:
    """A section seen from above: row 0 is that of the lowest y, column 0 that of the lowest x.

    Parameters
    ----------
    classes : Classes
        Of the labels.
    label : (rows, columns) int32 array
        Most probable class; `MISSING` where nothing was observed, or where nothing is.
    free : (rows, columns) bool array
        True where the map says that nothing is there; nowhere for maps without free space.
    entropy : (rows, columns) float array
        Of what is there, in nats, with "nothing" for an answer where the map keeps free space; NaN where nothing
        was observed.
    origin : (2,) array
        x and y in metres of the lower left corner.
    resolution : float
        Edge of a cell in metres.
    height : float
        z in metres.
    """

    classes: Classes
    label: NDArray[np.int32]
    free: NDArray[np.bool_]
    entropy: NDArray[np.float64]
    origin: NDArray[np.float64]
    resolution: float
    height: float

    def picture(self) -> Picture:
        """Return classes and entropy beside each other, y upwards, with keys and a scale bar."""
        named = paint_labels("class", self.label, self.classes, "not observed")
        named.colours[self.free] = _FREE_COLOUR
        sure = paint_values("entropy (nats)", self.entropy, 0.0)
        scale = max(1, -(-_PIXELS // max(self.label.shape)))
        pictures = [
            with_scale_bar(
                paint.colours[::-1].repeat(scale, axis=0).repeat(scale, axis=1), self.resolution / scale
            )
            for paint in (named, sure)
        ]
        size = max(13, pictures[0].shape[1] // 40)
        assert isinstance(sure.key, Bar)
        bar = colour_bar(sure.key.low, sure.key.high, width=max(pictures[1].shape[1], 20 * size), font_size=size)
        grid = panels([pictures[0], stack([pictures[1], bar])], [named.title, sure.title], 2, font_size=size)
        rows, columns = self.label.shape
        x, y = self.origin
        where = f"z = {self.height:g} m, x {x:.2f} to {x + columns * self.resolution:.2f} m, y {y:.2f} to "
        parts = [heading(f"{where}{y + rows * self.resolution:.2f} m", grid.shape[1], font_size=size), grid]
        key = named.key if isinstance(named.key, Classes) else None
        if key is not None:
            if self.free.any():
                key = Classes((*key.names, "free"), (*key.colours, _FREE_COLOUR))
            parts.append(legend(key, grid.shape[1], missing=named.missing, font_size=size))
        return stack(parts)


def section(
    semantic_map: SemanticMap,
    height: float,
    low: ArrayLike | None = None,
    high: ArrayLike | None = None,
    *,
    resolution: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Section:
    """Return the section of a map at one height.

    Parameters
    ----------
    semantic_map : SemanticMap
        Any map. Where its world has another axis upwards than z, height and corners are those of the level frame
        (`semgp.upward.level`).
    height : float
        z in metres.
    low, high : (2,) arrays, optional
        Corners, x and y in metres; left out, those of what is mapped.
    resolution : float, optional
        Edge of a cell in metres; left out, as fine as a picture shows.
    progress : callable, optional
        Called with the number of cells that are done and of all.

    Raises
    ------
    InputError
        Corners or a height that cannot be used, a resolution that is not positive, an empty map, or too many
        cells.
    """
    if not math.isfinite(height):
        raise InputError(f"height is z in metres, not {height}.")
    R = level(semantic_map.up)
    mapped = (semantic_map.positions @ R.T)[:, :2]
    if not len(mapped):
        raise InputError("the map is empty: build it from scans with labels.")
    a, b = box_corners(mapped.min(axis=0) if low is None else low, mapped.max(axis=0) if high is None else high, 2)
    edge = float((b - a).max()) / _PIXELS if resolution is None else require_positive("resolution", resolution)
    cells = cells_between(a[::-1], b[::-1], edge)
    label = np.empty(len(cells), dtype=np.int32)
    free, entropy = np.zeros(len(cells), dtype=bool), np.empty(len(cells))
    for part in slices(len(cells), BATCH):
        centres = cells.centres(np.arange(part.start, part.stop))[:, ::-1]
        answer = semantic_map.query(np.insert(centres, 2, height, axis=1) @ R)
        label[part], free[part], entropy[part] = _what_is_there(answer)
        if progress is not None:
            progress(part.stop, len(cells))
    shape = cells.shape
    return Section(
        semantic_map.classes, label.reshape(shape), free.reshape(shape), entropy.reshape(shape), a, edge, height
    )


def _what_is_there(answer: Prediction) -> tuple[NDArray[np.int32], NDArray[np.bool_], NDArray[np.float64]]:
    """Return label, whether nothing is there, and the entropy of both together, of M points."""
    entropy = np.where(answer.observed, answer.entropy, np.nan).astype(np.float64)
    if answer.occupancy is None:
        return answer.label, np.zeros(len(answer), dtype=bool), entropy
    state = answer.occupancy.state
    inside = np.where(answer.observed, answer.entropy, 0.0)
    joint = answer.occupancy.entropy + answer.occupancy.probability * inside
    label = np.where((state == FREE) | (state == UNKNOWN), MISSING, answer.label).astype(np.int32)
    return label, np.asarray(state == FREE), np.where(state == UNKNOWN, np.nan, joint)
