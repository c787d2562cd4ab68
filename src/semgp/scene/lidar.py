"""A spinning lidar, and the labels that a network gives its points: wrong and missing in patches."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from semgp.classes import MISSING
from semgp.errors import InputError
from semgp.scene.raycast import Solids, cast

_WEDGES = 24  # the rays go out in so many wedges, each cast against the solids that reach into it
_SCATTERED = 0.2  # share of the wrong labels that come singly
_HOLD = 10  # scans for which a cell keeps its fault: one second at 10 Hz


@dataclass(frozen=True)
class Lidar:
    """A lidar that spins about the vertical and measures all around.

    Parameters
    ----------
    beams, columns : int
        Rays above each other, and around.
    top, bottom : float
        Elevation of the highest and the lowest beam in degrees; the defaults are near those of the HDL-64E.
    reach : float
        Longest distance in metres that gives a return.
    noise : float
        Standard deviation of the measured distance in metres.

    Raises
    ------
    InputError
        Values outside their range.
    """

    beams: int = 64
    columns: int = 2000
    top: float = 3.0
    bottom: float = -25.0
    reach: float = 80.0
    noise: float = 0.02

    def __post_init__(self) -> None:
        if self.beams < 1 or self.columns < 1:
            raise InputError("a lidar needs at least one beam and one column.")
        if not -90 < self.bottom <= self.top < 90:
            raise InputError("bottom and top are elevations between -90 and 90 degrees, bottom not above top.")
        if not (0 < self.reach <= 200 and 0 <= self.noise < np.inf):
            raise InputError("reach lies above 0 m and goes up to 200 m, and noise must not be negative.")

    @property
    def rays(self) -> NDArray[np.float64]:
        """Unit direction of each ray, shape (columns, beams, 3): x ahead, y left, z up; anticlockwise."""
        azimuth = 2 * pi * np.arange(self.columns)[:, None] / self.columns
        elevation = np.radians(np.linspace(self.top, self.bottom, self.beams))
        flat = np.cos(elevation)
        parts = np.broadcast_arrays(np.cos(azimuth) * flat, np.sin(azimuth) * flat, np.sin(elevation))
        return np.stack(parts, axis=-1)

    def measure(
        self, solids: Solids, T_world_sensor: NDArray[np.float64], rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return what one turn of the lidar gives.

        Parameters
        ----------
        solids : Solids
            The scene; the lidar stands outside of all of them.
        T_world_sensor : (4, 4) array
            Pose of the lidar, upright: a turn about the vertical and a shift.
        rng : numpy.random.Generator
            Source of the noise.

        Returns
        -------
        points : (N, 3) array
            Measured points in metres, world frame, column by column.
        solid : (N,) integer array
            Index of the solid that each of them lies on.
        """
        origin = T_world_sensor[:3, 3]
        rays = self.rays @ T_world_sensor[:3, :3].T
        wedges = np.array_split(rays, min(_WEDGES, self.columns))
        parts = [self._cast(solids, origin, wedge) for wedge in wedges]
        distance, solid = (np.concatenate(part) for part in zip(*parts))
        returned = distance <= self.reach
        measured = distance[returned] + self.noise * rng.standard_normal(np.count_nonzero(returned))
        return origin + measured[:, None] * rays.reshape(-1, 3)[returned], solid[returned]

    def _cast(
        self, solids: Solids, origin: NDArray[np.float64], wedge: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return distance and solid for the rays of neighbouring columns; a solid elsewhere cannot be met."""
        middle = wedge[len(wedge) // 2, 0]
        offset = solids.centre[:, :2] - origin[:2]
        away, radius = np.hypot(*offset.T), np.hypot(*solids.half[:, :2].T)
        bearing = np.arctan2(offset[:, 1], offset[:, 0]) - np.arctan2(middle[1], middle[0])
        bearing = np.abs((bearing + pi) % (2 * pi) - pi)
        half_angle = (
            np.arcsin(np.minimum(radius / np.maximum(away, 1e-9), 1)) + pi * (len(wedge) + 1) / self.columns
        )
        seen = np.flatnonzero((away - radius <= self.reach) & ((bearing <= half_angle) | (away <= radius)))
        part = Solids(solids.shape[seen], solids.centre[seen], solids.half[seen], solids.yaw[seen])
        hits = cast(part, origin, wedge.reshape(-1, 3))
        return hits.distance, np.append(seen, -1)[hits.solid]  # -1, nothing met, picks the last entry


@dataclass(frozen=True)
class PatchFaults:
    """What is wrong with the labels that a network gives the points of a scan.

    Faults come by cells of a grid in the world: a cell keeps its fault for ten scans, then it is decided anew.
    One in five wrong labels comes on its own instead.

    Parameters
    ----------
    wrong : float
        Share of wrong labels, before some go missing.
    missing : float
        Share of missing labels.
    cell : float
        Edge of a cell in metres.

    Raises
    ------
    InputError
        Values outside their range.
    """

    wrong: float = 0.1
    missing: float = 0.0
    cell: float = 0.5

    def __post_init__(self) -> None:
        if not (0 <= self.wrong <= 1 and 0 <= self.missing <= 1 and 0.01 <= self.cell < np.inf):
            raise InputError("wrong and missing are shares between 0 and 1, and cell is at least 0.01 m.")

    def apply(
        self,
        points: NDArray[np.float64],
        labels: NDArray[np.int32],
        mistaken_for: NDArray[np.int32],
        seed: int,
        scan: int,
    ) -> NDArray[np.int32]:
        """Return a faulty copy of the labels of a scan.

        Parameters
        ----------
        points : (N, 3) array
            Points in metres, world frame.
        labels : (N,) array
            Their true labels.
        mistaken_for : (C, K) array
            Labels that a wrong one of each class may have; all K are equally likely.
        seed, scan : int
            The faults are those of this seed in this scan, neither negative.
        """
        rng = np.random.default_rng((seed, scan))
        n_wrong = np.uint64(mistaken_for.shape[1])
        fault = _cell_hash(np.floor(points / self.cell).astype(np.int64), seed)
        fault = _scramble(fault + (scan + fault % _HOLD) // _HOLD)  # not all cells change in the same scan
        singly = _SCATTERED * self.wrong
        alone = rng.random(len(points)) < singly
        together = _uniform(fault) < (self.wrong - singly) / (1 - singly)
        any_of_them = rng.integers(n_wrong, size=len(points), dtype=np.uint64)
        which = np.where(alone, any_of_them, _scramble(fault + 1) % n_wrong)
        given = np.where(alone | together, mistaken_for[labels, which], labels)
        given[_uniform(_scramble(fault + 2)) < self.missing] = MISSING
        return given


def _cell_hash(cells: NDArray[np.int64], seed: int) -> NDArray[np.uint64]:
    """Return 64 well mixed bits for each cell (N, 3)."""
    mixed = np.full(len(cells), seed % 2**64, dtype=np.uint64)
    for axis in cells.T:
        mixed = _scramble(mixed + axis.astype(np.uint64))
    return mixed


def _scramble(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the bits mixed well and one to one: the last step of SplitMix64 (Steele et al., 2014)."""
    bits = (bits ^ bits >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ bits >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return np.asarray(bits ^ bits >> np.uint64(31))


def _uniform(bits: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Return the bits as numbers evenly spread over [0, 1)."""
    return np.asarray((bits >> 11) * 2.0**-53)
