"""A synthetic town without end, scanned by the lidar of a car that drives through it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import ceil, floor, pi
from numbers import Integral

import numpy as np
from numpy.typing import NDArray

from semgp.checks import require_seed
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.scene.furniture import Thing, block
from semgp.scene.lidar import Lidar, PatchFaults
from semgp.scene.raycast import Solids
from semgp.scene.streets import BLOCK, MISTAKEN_FOR, ROAD, TOWN_CLASSES, town_block

_STEP = 1.0  # metres between two scans: 10 m/s at 10 Hz
_MAST = 1.73  # height of the lidar above the road in metres, as in KITTI
_BLOCKS_ACROSS, _CURVE = 8, 6.0  # the route turns round after so many blocks, in curves of this radius (m)
_SCANS = 10_000_000  # twelve days on the road, a thousand kilometres from the origin


@dataclass(frozen=True, eq=False)
class TownScan:
    """One turn of the lidar. Row i of `truth` and of `observed` is the same measured point.

    Parameters
    ----------
    truth : LabelledCloud
        The points with their true labels, and the pose.
    observed : LabelledCloud
        The same points with the labels that the robot gets, some of them missing or wrong.
    """

    truth: LabelledCloud
    observed: LabelledCloud


@dataclass(frozen=True)
class SyntheticTown:
    """A town of streets and blocks without end, and a car that scans it ten times a second at 10 m/s.

    Blocks are made where the lidar reaches and nowhere else, each from the seed and its place: every scan costs
    the same, and scans can be asked for in any order. The car drives in the right-hand lane, eight blocks
    forth and, one street further north, eight blocks back, so that the area seen grows with the distance.

    Parameters
    ----------
    seed : int
        Decides what stands where, sensor noise and label faults. The same seed gives the same scans.
    lidar : Lidar, optional
        The sensor.
    faults : PatchFaults, optional
        What is wrong with the observed labels.

    Raises
    ------
    InputError
        A seed that is not a whole number, or is negative.
    """

    seed: int = 0
    lidar: Lidar = field(default_factory=Lidar)
    faults: PatchFaults = field(default_factory=PatchFaults)

    def __post_init__(self) -> None:
        require_seed(self.seed)

    @property
    def classes(self) -> Classes:
        """The classes of the town."""
        return TOWN_CLASSES

    def pose(self, i: int) -> NDArray[np.float64]:
        """Return `T_world_sensor` (4, 4) of scan i: x ahead, y left, z up, the road at a height of zero.

        Raises
        ------
        InputError
            A scan that does not exist.
        """
        if not isinstance(i, Integral) or not 0 <= i < _SCANS:
            raise InputError(f"a scan's number is whole and lies between 0 and {_SCANS - 1}, not {i!r}.")
        place, heading = _route(int(i) * _STEP)
        T = np.eye(4)
        T[:2, :2] = (heading.real, -heading.imag), (heading.imag, heading.real)
        T[:3, 3] = place.real, place.imag, _MAST
        return T

    def things(self, i: int) -> Iterator[Thing]:
        """Yield what scan i could see: the road, and all that stands on the blocks that the lidar reaches."""
        x, y, _ = self.pose(i)[:3, 3]
        reach = self.lidar.reach
        yield Thing("road", (block((x - reach, x + reach), (y - reach, y + reach), (-1, 0), (70, 70, 70)),))
        for column in range(floor((x - reach) / BLOCK), ceil((x + reach) / BLOCK)):
            for row in range(floor((y - reach) / BLOCK), ceil((y + reach) / BLOCK)):
                yield from town_block(self.seed, column, row)

    def scan(self, i: int) -> TownScan:
        """Return scan i, the same at every call.

        Raises
        ------
        InputError
            A scan that does not exist.
        """
        T = self.pose(i)
        parts = [(solid, TOWN_CLASSES.index(thing.name)) for thing in self.things(i) for solid in thing.solids]
        solids = Solids(
            np.array([solid.shape for solid, _ in parts]),
            np.array([solid.centre for solid, _ in parts]),
            np.array([solid.half for solid, _ in parts]),
            np.array([solid.yaw for solid, _ in parts]),
        )
        points, solid = self.lidar.measure(solids, T, np.random.default_rng((self.seed, i)))
        labels = np.array([label for _, label in parts], dtype=np.int32)[solid]
        given = self.faults.apply(points, labels, MISTAKEN_FOR, self.seed, int(i))
        return TownScan(
            truth=LabelledCloud(points, TOWN_CLASSES, labels, T_world_sensor=T),
            observed=LabelledCloud(points, TOWN_CLASSES, given, T_world_sensor=T),
        )


def _route(way: float) -> tuple[complex, complex]:
    """Return place and heading after so many metres of way, as complex numbers x + i y."""
    far, up, bend = _BLOCKS_ACROSS * BLOCK - 2 * _CURVE, BLOCK - 2 * _CURVE, _CURVE * pi / 2
    lap, left = divmod(way, 2 * (far + up) + 4 * bend)
    place, heading = complex(_CURVE, 2 * BLOCK * lap), 1 + 0j
    for straight, turn in ((far, 1j), (up, 1j), (far, -1j), (up, -1j)):
        ahead = min(left, straight)
        angle = min(left - ahead, bend) / _CURVE
        place += heading * (ahead + _CURVE * (np.sin(angle) + turn * (1 - np.cos(angle))))
        heading *= np.cos(angle) + turn * np.sin(angle)
        left -= ahead + angle * _CURVE
    return place - 1j * heading * ROAD / 2, heading
