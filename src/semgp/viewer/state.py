"""What a viewer shows: a map asked at points, and the choices of who looks, as plain arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.maps.batches import query_in_batches
from semgp.maps.protocol import SemanticMap
from semgp.picture.colour import by_class, by_value
from semgp.prediction import Prediction
from semgp.viewer.fields import CLASS, Scale, field_scale, field_values
from semgp.viewer.surface import Surface

F64 = NDArray[np.float64]
Progress = Callable[[int, int], None]
"""Called with how many points have been asked for and of how many; may raise to give up."""


@dataclass(frozen=True, eq=False)
class Sample:
    """What a map says at points along its surface.

    Parameters
    ----------
    points : (M, 3) array
        Metres, world frame.
    normals : (M, 3) array
        Of the surface, see `Surface.normals`.
    prediction : Prediction
        The answers.
    resolution : float
        How far apart the points are, metres.
    """

    points: F64
    normals: F64
    prediction: Prediction
    resolution: float


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
    """

    resolution: float
    field: str = CLASS
    hidden: frozenset[int] = frozenset()
    low: tuple[float, float, float] = (-math.inf,) * 3
    high: tuple[float, float, float] = (math.inf,) * 3
    size: float = 1.0
    off: frozenset[str] = frozenset()
    scans: int = 0

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

    @property
    def points(self) -> F64:
        """Positions (K, 3), metres."""
        return self.sample.points[self.rows]


def take_sample(
    semantic_map: SemanticMap, surface: Surface, resolution: float, most: int, progress: Progress | None = None
) -> Sample:
    """Ask a map along its surface.

    Parameters
    ----------
    semantic_map : SemanticMap
        The map.
    surface : Surface
        Its surface.
    resolution : float
        How far apart the points are to be, metres; more where that would be too many.
    most : int
        The most points.
    progress : callable, optional
        See `Progress`.

    Raises
    ------
    InputError
        A resolution that is not positive.
    """
    points, resolution = surface.points(resolution, most)
    return Sample(points, surface.normals(points), query_in_batches(semantic_map, points, progress), resolution)


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


def lit(shown: Shown, up: ArrayLike) -> NDArray[np.uint8]:
    """Return the colours (K, 3) of what is seen, darker where the surface turns from a lamp above and aside.

    Parameters
    ----------
    shown : Shown
        What is seen.
    up : (3,) array
        Upward direction of the world, of length one.
    """
    lamp = np.add(up, (0.45, 0.3, 0.2))
    normals = shown.sample.normals[shown.rows]
    facing = np.abs(normals @ lamp) / np.linalg.norm(lamp)
    share = np.where(normals.any(axis=1), 0.7 + 0.3 * facing, 0.85)
    return np.rint(shown.colours * share[:, None]).astype(np.uint8)


def pick(shown: Shown, origin: ArrayLike, direction: ArrayLike) -> int | None:
    """Return the row of the sample that a ray meets first, or None.

    A point is met where the ray passes within the sample's resolution, or a half per cent of the distance.

    Parameters
    ----------
    shown : Shown
        What is seen.
    origin, direction : (3,) array
        The ray, metres, world frame.
    """
    if not len(shown.rows):
        return None
    along = np.asarray(direction, dtype=np.float64)
    along = along / np.linalg.norm(along)
    to = shown.points - np.asarray(origin, dtype=np.float64)
    depth = to @ along
    aside = np.linalg.norm(to - depth[:, None] * along, axis=1)
    met = (depth > 0) & (aside < np.maximum(0.7 * shown.sample.resolution, 0.005 * depth))
    if not met.any():
        return None
    first = depth[met].min() + 2 * shown.sample.resolution  # of what lies there, the nearest to the ray
    candidates = np.flatnonzero(met & (depth <= first))
    return int(shown.rows[candidates[np.argmin(aside[candidates])]])
