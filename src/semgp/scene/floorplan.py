"""A floor of a building: rooms along a corridor, doors that stand open, and what is in them, from one seed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, pi, radians, sin

import numpy as np

from semgp.classes import Classes
from semgp.scene.area import Area
from semgp.scene.furnishing import PAINT, WAY, furnished
from semgp.scene.furniture import Thing, block

LENGTH, WIDTH, HEIGHT = 20.0, 15.0, 2.6
"""Size of the building in metres along x, y and z, between the middles of its outer walls; z = 0 is the floor,
x = y = 0 its south-western corner."""

BUILDING_CLASSES = Classes(
    names=("floor", "wall", "ceiling", "door", "table", "chair", "cabinet", "shelf", "plant"),
    colours=(
        *((222, 184, 135), (120, 144, 178), (226, 206, 226), (250, 206, 46), (240, 134, 40)),
        *((206, 52, 58), (138, 74, 170), (60, 90, 190), (70, 160, 60)),
    ),
)
"""The nine classes of the building."""

_MISTAKEN_FOR = {
    "floor": ("wall", "door"),
    "wall": ("door", "cabinet"),
    "ceiling": ("wall", "shelf"),
    "door": ("wall", "cabinet"),
    "table": ("cabinet", "chair"),
    "chair": ("table", "plant"),
    "cabinet": ("shelf", "door"),
    "shelf": ("cabinet", "wall"),
    "plant": ("chair", "shelf"),
}

MISTAKEN_FOR = np.array(
    [[BUILDING_CLASSES.index(other) for other in _MISTAKEN_FOR[name]] for name in BUILDING_CLASSES.names],
    dtype=np.int32,
)
"""Labels (9, 2) of the classes that a network is apt to take each class for."""

_HALF_WALL, _DOOR_HEIGHT = 0.07, 2.05  # metres
_INSET = _HALF_WALL + 0.02  # metres from the middle of a wall to the furniture before it
_DOORWAY = 1.0  # metres between the posts
_MIN_WIDTH = 3.8  # metres, of a room along the corridor
_USES = (
    ("desk", "desk", "shelf", "cabinet", "plant"),
    ("table", "cabinet", "plant", "shelf"),
    ("shelf", "shelf", "shelf", "cabinet", "cabinet"),
    ("table", "chairs", "plant", "plant", "cabinet"),
    ("desk", "desk", "desk", "shelf", "shelf"),
)
_CORRIDOR = ("cabinet", "chairs", "plant", "plant")
_LEAF = (120, 84, 60)


@dataclass(frozen=True)
class FloorPlan:
    """The rooms, of which the first is the corridor, and all that the building is made of and holds."""

    rooms: tuple[Area, ...]
    things: tuple[Thing, ...]


def floor_plan(seed: int) -> FloorPlan:
    """Return the building of a seed: a corridor along x, and rooms to the south and north of it."""
    rng = np.random.default_rng(seed)
    south, north = rng.uniform(6.0, 6.6), rng.uniform(8.4, 9.0)
    corridor = Area((0, LENGTH), (south, north))
    rooms, things = [corridor], _shell((south + north) / 2)
    for depth, x, y, turned in ((south, LENGTH, south, True), (WIDTH - north, 0.0, north, False)):
        side_rooms, side_things = _side(rng, depth)
        rooms += [room.turned().moved(x, y) if turned else room.moved(x, y) for room in side_rooms]
        things += [thing.at(x, y, yaw=pi * turned) for thing in side_things]
    return FloorPlan(tuple(rooms), (*things, *furnished(rng, corridor.grown(-_INSET), _CORRIDOR, things, WAY)))


def _shell(entrance: float) -> list[Thing]:
    """Return floor, ceiling, outer walls, and the closed front door at the western end of the corridor."""
    x, y, t = (0, LENGTH), (0, WIDTH), _HALF_WALL
    walls = [block((a - t, a + t), y, (0, HEIGHT), PAINT) for a in x]
    walls += [block(x, (b - t, b + t), (0, HEIGHT), PAINT) for b in y]
    front_door = block((0, t + 0.03), (entrance - 0.6, entrance + 0.6), (0, _DOOR_HEIGHT), _LEAF)
    return [
        Thing("floor", (block(x, y, (-0.2, 0), PAINT),)),
        Thing("ceiling", (block(x, y, (HEIGHT, HEIGHT + 0.2), PAINT),)),
        Thing("wall", tuple(walls)),
        Thing("door", (front_door,)),
    ]


def _side(rng: np.random.Generator, depth: float) -> tuple[list[Area], list[Thing]]:
    """Return the furnished rooms on one side of the corridor, which lies along y = 0, the rooms above it."""
    n = rng.integers(3, 5)
    width = _MIN_WIDTH + (LENGTH - n * _MIN_WIDTH) * rng.dirichlet(np.full(n, 2.0))
    edges = list(pairwise([0.0, *np.cumsum(width[:-1]), LENGTH]))
    halved = rng.integers(n)  # this room has a second one behind it
    half = depth * rng.uniform(0.5, 0.58)
    fronts = [half if i == halved else depth for i in range(n)]
    rooms = [Area(edge, (0, front)) for edge, front in zip(edges, fronts)]
    rooms.append(Area(edges[halved], (half, depth)))
    things = _wall(LENGTH, [rng.uniform(a + 1.2, b - 1.2) for a, b in edges])
    left, right = edges[halved]
    things += [thing.at(left, half) for thing in _wall(right - left, [rng.uniform(1.2, right - left - 1.2)])]
    for (_, x), *shared in zip(edges[:-1], fronts[:-1], fronts[1:]):
        doors = [rng.uniform(1.3, min(shared) - 1.3)] if rng.random() < 0.4 else []
        things += [thing.at(x, 0, yaw=pi / 2) for thing in _wall(depth, doors)]
    uses = [_USES[i % len(_USES)] for i in rng.permutation(len(rooms))]
    return rooms, things + [
        thing for room, use in zip(rooms, uses) for thing in furnished(rng, room.grown(-_INSET), use, things)
    ]


def _wall(length: float, doors: list[float]) -> list[Thing]:
    """Return a wall from the origin along x, and doors in it that stand open to the left of it (y > 0)."""
    half, t = _DOORWAY / 2 + 0.05, _HALF_WALL
    edges = [0.0, *(edge for door in sorted(doors) for edge in (door - half, door + half)), length]
    pieces = [block((a, b), (-t, t), (0, HEIGHT), PAINT) for a, b in zip(edges[::2], edges[1::2])]
    lintels = [block((x - half, x + half), (-t, t), (_DOOR_HEIGHT, HEIGHT), PAINT) for x in doors]
    return [Thing("wall", (*pieces, *lintels)), *(_door().at(x, 0) for x in doors)]


def _door() -> Thing:
    """Return posts and head of a door, and its leaf, open by 100 degrees."""
    half, t, angle = _DOORWAY / 2, _HALF_WALL + 0.02, radians(100)
    posts = [block((x, x + 0.05), (-t, t), (0, _DOOR_HEIGHT), _LEAF) for x in (-half - 0.05, half)]
    head = block((-half, half), (-t, t), (_DOOR_HEIGHT - 0.05, _DOOR_HEIGHT), _LEAF)
    middle = (_DOORWAY / 2 * cos(angle) - half, _DOORWAY / 2 * sin(angle) + t, _DOOR_HEIGHT / 2)
    leaf = replace(block((-half, half), (-0.02, 0.02), (0, _DOOR_HEIGHT - 0.05), _LEAF), centre=middle, yaw=angle)
    return Thing("door", (*posts, head, leaf))
