"""A synthetic building to explore: what a robot's lidar sees in it, where the robot fits, and what is true."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import cos, isfinite, sin
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.checks import require_finite, require_seed, rigid_transform
from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.scene.floorplan import BUILDING_CLASSES, HEIGHT, LENGTH, MISTAKEN_FOR, WIDTH, FloorPlan, floor_plan
from semgp.scene.lidar import Lidar, PatchFaults
from semgp.scene.raycast import Solids, cast
from semgp.scene.standing import connected, touches
from semgp.voxels import voxel_keys

ROBOT_HEIGHT, MAST = 1.1, 1.0
"""Height of the robot, and of the lidar on it, above the floor in metres."""

INDOOR_LIDAR = Lidar(beams=16, columns=360, top=30, bottom=-30, reach=6.0, noise=0.01)
"""A small lidar that sees floor and ceiling, but not far: exploring a building takes many scans."""

_SILL = 0.03  # metres: what is lower does not stop the robot
_SURVEY_STEP = 1.5  # metres between the places that a survey scans from


@dataclass(frozen=True, eq=False)
class SyntheticBuilding:
    """One floor of a building, 20 m x 15 m: eight to ten furnished rooms on a corridor, their doors open.

    The plan's origin is the south-western corner of the floor. A round robot comes in at the western end of the
    corridor; wherever it goes, it can scan.

    Parameters
    ----------
    seed : int
        Decides rooms, furniture, sensor noise and label faults. The same seed gives the same scans.
    lidar : Lidar, optional
        The sensor.
    faults : PatchFaults, optional
        What is wrong with the labels of the scans.

    Raises
    ------
    InputError
        A seed that is not a whole number, or is negative.
    """

    seed: int = 0
    lidar: Lidar = INDOOR_LIDAR
    faults: PatchFaults = field(default_factory=PatchFaults)

    def __post_init__(self) -> None:
        require_seed(self.seed)

    @property
    def classes(self) -> Classes:
        """The classes of the building."""
        return BUILDING_CLASSES

    @property
    def size(self) -> NDArray[np.float64]:
        """Length, width and height (3,) in metres, along x, y and z."""
        return np.array([LENGTH, WIDTH, HEIGHT])

    @cached_property
    def plan(self) -> FloorPlan:
        """The rooms, and the objects of the building."""
        return floor_plan(int(self.seed))

    @property
    def entrance(self) -> NDArray[np.float64]:
        """Where the robot begins, (2,), metres: inside of the front door, which is closed behind it."""
        return np.array([0.8, np.mean(self.plan.rooms[0].y)])

    def pose(self, position: ArrayLike, heading: float = 0.0) -> NDArray[np.float64]:
        """Return `T_world_sensor` (4, 4) of the lidar on a robot at a position (2,) that looks along `heading`.

        Parameters
        ----------
        position : (2,) array
            x and y in metres.
        heading : float
            Angle from the x axis in radians, anticlockwise.

        Raises
        ------
        InputError
            A position of another shape, or numbers that are not finite.
        """
        if not isfinite(heading):
            raise InputError(f"a heading is an angle in radians, not {heading}.")
        T = np.eye(4)
        T[:2, :2] = (cos(heading), -sin(heading)), (sin(heading), cos(heading))
        T[:3, 3] = *_plan_points(np.asarray(position)[None])[0], MAST
        return T

    def scan(self, T_world_sensor: ArrayLike, number: int = 0) -> LabelledCloud:
        """Return what the lidar sees: points, labels as a network gives them, and the pose.

        Rays that meet nothing within the lidar's reach give no point, as with real sensors, so that the cloud does
        not tell of the free space along them. Indoors they are few: the lidar's longest rays end at walls.

        Parameters
        ----------
        T_world_sensor : (4, 4) array
            Pose of the lidar, upright, see `pose`.
        number : int, optional
            Noise and label faults are those of the scan of this number; faults last for some scans, see
            `PatchFaults`.

        Raises
        ------
        InputError
            No upright pose, a lidar outside of the building or in something, or a number that is negative.
        """
        T = rigid_transform("T_world_sensor", T_world_sensor)
        if not np.allclose(T[2, :3], (0, 0, 1), atol=1e-6):
            raise InputError("the lidar must stand upright: T_world_sensor may turn about the vertical only.")
        if not (0 < T[2, 3] < HEIGHT and self.is_free(T[None, :2, 3], 0.0)[0]):
            raise InputError(f"the lidar cannot stand at {T[:3, 3]} m: something does, or it is not inside.")
        if not isinstance(number, Integral) or number < 0:
            raise InputError(f"a scan's number is whole and not negative, not {number!r}.")
        points, solid = self.lidar.measure(self._solids, T, np.random.default_rng((int(self.seed), int(number))))
        labels = self.faults.apply(points, self._labels[solid], MISTAKEN_FOR, int(self.seed), int(number))
        return LabelledCloud(points, BUILDING_CLASSES, labels, T_world_sensor=T)

    def is_free(self, points: ArrayLike, radius: float) -> NDArray[np.bool_]:
        """Return where a round robot would stand in the building without touching anything, (N,).

        Parameters
        ----------
        points : (N, 2) array
            Middles of the robot in metres.
        radius : float
            The robot's, in metres; it is 1.1 m high, and does not drive under tables.

        Raises
        ------
        InputError
            Points of another shape or that are not finite, or a radius that is negative.
        """
        X = _plan_points(points)
        if not radius >= 0:
            raise InputError(f"a radius must not be negative, but is {radius}.")
        inside = ((radius < X) & (self.size[:2] - radius > X)).all(axis=1)
        return np.asarray(inside & ~touches(X, radius, self._obstacles))

    def reachable(self, radius: float, spacing: float = 0.1) -> NDArray[np.float64]:
        """Return the places of a grid, (N, 2), that a robot of a radius can get to from the entrance, metres.

        Ways lead from each place of the grid to its four neighbours.

        Raises
        ------
        InputError
            A spacing that is not positive, or a robot that does not fit where it begins.
        """
        if not 0 < spacing < np.inf:
            raise InputError(f"the spacing of a grid must be above zero, but is {spacing}.")
        axes = [np.arange(spacing / 2, size, spacing) for size in self.size[:2]]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        free = self.is_free(grid.reshape(-1, 2), radius).reshape(grid.shape[:2])
        i, j = (self.entrance / spacing).astype(int)
        if not free[i, j]:
            raise InputError(
                f"a robot of a radius of {radius} m does not fit at the entrance: take a smaller one."
            )
        return np.asarray(grid[connected(free, (i, j))])

    def surfaces(self, radius: float, resolution: float = 0.1) -> LabelledCloud:
        """Return the surfaces that the lidar sees from where a robot can get to, with their true labels.

        Its rays go out, without noise, from a grid of places 1.5 m apart; of the points in each voxel, one stays.

        Parameters
        ----------
        radius : float
            The robot's, in metres.
        resolution : float, optional
            Edge of a voxel in metres.

        Raises
        ------
        InputError
            A robot that does not fit where it begins, or a resolution that is not positive.
        """
        if not 0 < resolution < np.inf:
            raise InputError(f"a resolution must be above zero, but is {resolution}.")
        places = self.reachable(radius)
        _, one_each = np.unique(places // _SURVEY_STEP, axis=0, return_index=True)
        rays = self.lidar.rays.reshape(-1, 3)
        origins = np.insert(np.repeat(places[one_each], len(rays), axis=0), 2, MAST, axis=1)
        rays = np.tile(rays, (len(one_each), 1))
        hits = cast(self._solids, origins, rays)
        met = hits.distance <= self.lidar.reach
        points = origins[met] + hits.distance[met, None] * rays[met]
        _, first = np.unique(voxel_keys(points, resolution), return_index=True)
        return LabelledCloud(points[first], BUILDING_CLASSES, self._labels[hits.solid[met][first]])

    @cached_property
    def _solids(self) -> Solids:
        parts = [solid for thing in self.plan.things for solid in thing.solids]
        return Solids(
            np.array([solid.shape for solid in parts]),
            np.array([solid.centre for solid in parts]),
            np.array([solid.half for solid in parts]),
            np.array([solid.yaw for solid in parts]),
        )

    @cached_property
    def _labels(self) -> NDArray[np.int32]:
        """Label of each solid."""
        labels = [BUILDING_CLASSES.index(thing.name) for thing in self.plan.things for _ in thing.solids]
        return np.array(labels, dtype=np.int32)

    @cached_property
    def _obstacles(self) -> Solids:
        """The solids that reach into the heights between a sill and the robot's top."""
        s = self._solids
        low, high = s.centre[:, 2] - s.half[:, 2], s.centre[:, 2] + s.half[:, 2]
        hit = (low < ROBOT_HEIGHT) & (high > _SILL)
        return Solids(s.shape[hit], s.centre[hit], s.half[hit], s.yaw[hit])


def _plan_points(points: ArrayLike) -> NDArray[np.float64]:
    """Return points (N, 2) as float64, checked."""
    X = np.asarray(points, dtype=np.float64)
    if X.ndim != 2 or X.shape[1] != 2:
        raise InputError(f"points of the floor must have shape (N, 2), not {X.shape}.")
    require_finite("points", X)
    return X
