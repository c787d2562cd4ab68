"""A floor of a building: rooms along a corridor, doors that stand open, and furniture, from one seed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, pi, radians, sin

import numpy as np

from semgp.classes import Classes
from semgp.scene import furniture as make
from semgp.scene.furniture import Solid, Thing, block, disc
from semgp.scene.raycast import ELLIPSOID

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

_HALF_WALL, _DOOR_HEIGHT = 0.07, 2.05
_DOORWAY = 1.0  # metres between the posts
_DOOR_CLEARANCE = 0.6  # metres around a door and its open leaf where nothing stands
_MIN_WIDTH = 3.8  # metres, of a room along the corridor
_WAY, _TRIES = 1.0, 20  # metres left free around tables, and places tried for a piece of furniture
_USES = (
    ("desk", "desk", "shelf", "cabinet", "plant"),
    ("table", "cabinet", "plant", "shelf"),
    ("shelf", "shelf", "shelf", "cabinet", "cabinet"),
    ("table", "chairs", "plant", "plant", "cabinet"),
    ("desk", "desk", "desk", "shelf", "shelf"),
)
_CORRIDOR = ("cabinet", "chairs", "plant", "plant")
_PAINT, _DARK, _LEAF = (226, 220, 208), (70, 72, 78), (120, 84, 60)
_GREEN, _CLAY, _CLOTH = (70, 130, 60), (170, 98, 70), (52, 86, 102)


@dataclass(frozen=True)
class Area:
    """An upright rectangle of the plan: limits along x and y in metres."""

    x: tuple[float, float]
    y: tuple[float, float]

    def grown(self, margin: float) -> Area:
        """Return the rectangle with each side moved outwards."""
        return Area((self.x[0] - margin, self.x[1] + margin), (self.y[0] - margin, self.y[1] + margin))

    def moved(self, x: float, y: float) -> Area:
        """Return the rectangle after a shift."""
        return Area((self.x[0] + x, self.x[1] + x), (self.y[0] + y, self.y[1] + y))

    def turned(self) -> Area:
        """Return the rectangle after half a turn about the origin."""
        return Area((-self.x[1], -self.x[0]), (-self.y[1], -self.y[0]))

    def contains(self, other: Area) -> bool:
        """Return whether another rectangle lies in this one."""
        return all(a[0] <= b[0] and b[1] <= a[1] for a, b in ((self.x, other.x), (self.y, other.y)))

    def overlaps(self, other: Area) -> bool:
        """Return whether the two rectangles share a place."""
        return all(a[0] < b[1] and b[0] < a[1] for a, b in ((self.x, other.x), (self.y, other.y)))


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
    return FloorPlan(tuple(rooms), (*things, *_furnish(rng, corridor, _CORRIDOR, things, _WAY)))


def _shell(entrance: float) -> list[Thing]:
    """Return floor, ceiling, outer walls, and the closed front door at the western end of the corridor."""
    x, y, t = (0, LENGTH), (0, WIDTH), _HALF_WALL
    walls = [block((a - t, a + t), y, (0, HEIGHT), _PAINT) for a in x]
    walls += [block(x, (b - t, b + t), (0, HEIGHT), _PAINT) for b in y]
    front_door = block((0, t + 0.03), (entrance - 0.6, entrance + 0.6), (0, _DOOR_HEIGHT), _LEAF)
    return [
        Thing("floor", (block(x, y, (-0.2, 0), _PAINT),)),
        Thing("ceiling", (block(x, y, (HEIGHT, HEIGHT + 0.2), _PAINT),)),
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
    return rooms, things + [thing for room, use in zip(rooms, uses) for thing in _furnish(rng, room, use, things)]


def _wall(length: float, doors: list[float]) -> list[Thing]:
    """Return a wall from the origin along x, and doors in it that stand open to the left of it (y > 0)."""
    half, t = _DOORWAY / 2 + 0.05, _HALF_WALL
    edges = [0.0, *(edge for door in sorted(doors) for edge in (door - half, door + half)), length]
    pieces = [block((a, b), (-t, t), (0, HEIGHT), _PAINT) for a, b in zip(edges[::2], edges[1::2])]
    lintels = [block((x - half, x + half), (-t, t), (_DOOR_HEIGHT, HEIGHT), _PAINT) for x in doors]
    return [Thing("wall", (*pieces, *lintels)), *(_door().at(x, 0) for x in doors)]


def _door() -> Thing:
    """Return posts and head of a door, and its leaf, open by 100 degrees."""
    half, t, angle = _DOORWAY / 2, _HALF_WALL + 0.02, radians(100)
    posts = [block((x, x + 0.05), (-t, t), (0, _DOOR_HEIGHT), _LEAF) for x in (-half - 0.05, half)]
    head = block((-half, half), (-t, t), (_DOOR_HEIGHT - 0.05, _DOOR_HEIGHT), _LEAF)
    middle = (_DOORWAY / 2 * cos(angle) - half, _DOORWAY / 2 * sin(angle) + t, _DOOR_HEIGHT / 2)
    leaf = replace(block((-half, half), (-0.02, 0.02), (0, _DOOR_HEIGHT - 0.05), _LEAF), centre=middle, yaw=angle)
    return Thing("door", (*posts, head, leaf))


def _furnish(
    rng: np.random.Generator, room: Area, use: tuple[str, ...], standing: list[Thing], way: float = 0.05
) -> list[Thing]:
    """Return the furniture of a room: each piece where there is space, with a way between it and the others."""
    taken = [_footprint([thing]).grown(_DOOR_CLEARANCE) for thing in standing if thing.name == "door"]
    inner, placed = room.grown(-_HALF_WALL - 0.02), list[Thing]()
    for piece in use:
        for _ in range(_TRIES):
            group = _at_a_wall(rng, _group(rng, piece), inner)
            area = _footprint(group)
            apart = area.grown(_WAY if any(thing.name == "table" for thing in group) else way)
            if inner.contains(area) and not any(apart.overlaps(other) for other in taken):
                taken.append(area)
                placed += group
                break
    return placed


def _at_a_wall(rng: np.random.Generator, group: list[Thing], room: Area) -> list[Thing]:
    """Return a group of things with its origin on one of the walls and its back, y > 0, to the wall."""
    x, y = rng.uniform(*room.x), rng.uniform(*room.y)
    places = (x, room.y[1], 0.0), (room.x[0], y, pi / 2), (x, room.y[0], pi), (room.x[1], y, -pi / 2)
    at = places[rng.integers(4)]
    return [thing.at(*at[:2], yaw=at[2]) for thing in group]


def _group(rng: np.random.Generator, piece: str) -> list[Thing]:
    """Return a piece of furniture, its back at y = 0, or a table with the chairs that belong to it."""
    if piece == "shelf":
        return [_shelf(rng).at(0, -0.17)]
    if piece == "cabinet":
        return [make.cabinet(_PAINT).at(0, -0.23)]
    if piece == "plant":
        return [_plant(rng).at(0, -0.4)]
    if piece == "chairs":
        return [make.chair(_CLOTH).at(x, -0.25) for x in (-0.6, 0.0, 0.6)]
    if piece == "desk":
        return [make.table().at(0, -0.45), make.chair(_CLOTH).at(0, -1.0, yaw=pi + rng.normal(0, 0.3))]
    seats = [(x, y, yaw) for x in (-0.7, 0.7) for y, yaw in ((-1.35, 0.0), (-2.7, pi))]  # a way behind the chairs
    chairs = [make.chair(_CLOTH).at(x, y, yaw=yaw + rng.normal(0, 0.2)) for x, y, yaw in seats]
    return [*(make.table().at(x, -2.02) for x in (-0.75, 0.75)), *chairs]


def _shelf(rng: np.random.Generator) -> Thing:
    """Return a shelf with a row of books on each board, 1.2 m wide, 1.9 m high."""
    heights = (0.06, 0.44, 0.82, 1.2, 1.58)
    frame = [block((x - 0.012, x + 0.012), (-0.16, 0.16), (0, 1.9), make.OAK) for x in (-0.6, 0.6)]
    boards = [block((-0.6, 0.6), (-0.16, 0.16), (z, z + 0.025), make.OAK) for z in (*heights, 1.88)]
    books = [block((-0.58, rng.uniform(-0.2, 0.55)), (-0.1, 0.14), (z, z + 0.26), _CLAY) for z in heights]
    return Thing("shelf", (*frame, *boards, *books, block((-0.6, 0.6), (0.14, 0.16), (0, 1.9), make.WALNUT)))


def _plant(rng: np.random.Generator) -> Thing:
    """Return a plant in a pot, 1.2 to 1.7 m high."""
    height, radius = rng.uniform(0.4, 0.65), rng.uniform(0.22, 0.35)
    crown = Solid(ELLIPSOID, (0, 0, 0.4 + height), (radius, radius, height), _GREEN)
    return Thing("plant", (disc(0, 0, (0, 0.4), 0.18, _CLAY), disc(0, 0, (0.4, 0.6), 0.03, _DARK), crown))


def _footprint(things: list[Thing]) -> Area:
    """Return the rectangle that some things fill, seen from above."""
    solids = [solid for thing in things for solid in thing.solids]
    middle, half = (np.array([getattr(solid, name)[:2] for solid in solids]) for name in ("centre", "half"))
    yaw = np.array([solid.yaw for solid in solids])
    c, s = np.abs(np.cos(yaw)), np.abs(np.sin(yaw))
    reach = np.stack([c * half[:, 0] + s * half[:, 1], s * half[:, 0] + c * half[:, 1]], axis=1)
    (left, bottom), (right, top) = (middle - reach).min(axis=0), (middle + reach).max(axis=0)
    return Area((float(left), float(right)), (float(bottom), float(top)))
