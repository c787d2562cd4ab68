"""The choices of who looks, and what is seen of a sample by them, as plain arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from semgp.picture.colour import by_class, by_value
from semgp.viewer.fields import CLASS, Scale, field_scale, field_values
from semgp.viewer.sample import Sample

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class ViewState:
    """The choices of who looks.

    Parameters
    ----------
    resolution : float
        How far apart the points are to be, metres.
    field : str
        What they are coloured by, see `semgp.viewer.fields`.
    hidden : frozenset of int
        Labels that are not shown, `MISSING` among them for what is not observed.
    low, high : (float, float, float)
        Corners of the box outside of which all is cut away, metres.
    size : float
        Size of the points, 1 that of their distance.
    off : frozenset of str
        Layers that are not shown.
    scans : int
        In playback, how many scans the map is built from.
    see_inside : bool
        Whether walls are left out where only their back would be seen, see `semgp.viewer.sight`.
    """

    resolution: float
    field: str = CLASS
    hidden: frozenset[int] = frozenset()
    low: tuple[float, float, float] = (-math.inf,) * 3
    high: tuple[float, float, float] = (math.inf,) * 3
    size: float = 1.0
    off: frozenset[str] = frozenset()
    scans: int = 0
    see_inside: bool = True

    def inside(self, points: F64) -> NDArray[np.bool_]:
        """Return which points (N, 3) the section leaves."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=1))

    def switched(self, label: int, on: bool) -> ViewState:
        """Return the choices with a class on or off."""
        return replace(self, hidden=self.hidden - {label} if on else self.hidden | {label})


@dataclass(frozen=True, eq=False)
class Shown:
    """The points of a sample that are seen.

    Parameters
    ----------
    sample : Sample
        All points.
    rows : (K,) integer array
        Those that are seen.
    colours : (K, 3) uint8 array
        Their colours.
    scale : Scale or None
        What the colours mean; None where they are the classes' own.
    """

    sample: Sample
    rows: NDArray[np.int64]
    colours: NDArray[np.uint8]
    scale: Scale | None

    @cached_property
    def points(self) -> F64:
        """Positions (K, 3), metres."""
        return self.sample.points[self.rows]

    @cached_property
    def normals(self) -> F64:
        """Where the surface faces (K, 3), see `Sample`."""
        return self.sample.normals[self.rows]

    @cached_property
    def one_sided(self) -> NDArray[np.bool_]:
        """Whether it is seen from there only (K,)."""
        return self.sample.one_sided[self.rows]


def show(sample: Sample, state: ViewState) -> Shown:
    """Return what is seen of a sample.

    Raises
    ------
    InputError
        The map has no such field.
    """
    prediction = sample.prediction
    rows = np.flatnonzero(~np.isin(prediction.label, list(state.hidden)) & state.inside(sample.points))
    if state.field == CLASS:
        return Shown(sample, rows, by_class(prediction.label[rows], prediction.classes), None)
    scale = field_scale(prediction, state.field)
    values = field_values(prediction, state.field)[rows]
    return Shown(sample, rows, by_value(values, scale.low, scale.high, scale.colour_map), scale)
