"""Furniture placed in rooms: at the walls, apart from each other and from doors."""

from __future__ import annotations

from math import pi

import numpy as np

from semgp.scene import furniture as make
from semgp.scene.area import Area, footprint
from semgp.scene.furniture import Solid, Thing, block, disc
from semgp.scene.raycast import ELLIPSOID

PAINT = (226, 220, 208)
"""Colour of walls, and of cabinets."""

WAY = 1.0
"""Metres left free around tables."""

_DOOR_CLEARANCE = 0.6  # metres around a door and its open leaf where nothing stands
_TRIES = 20  # places tried for a piece of furniture
_DARK = (70, 72, 78)
_GREEN, _CLAY, _CLOTH = (70, 130, 60), (170, 98, 70), (52, 86, 102)


def furnished(
    rng: np.random.Generator, room: Area, use: tuple[str, ...], standing: list[Thing], way: float = 0.05
) -> list[Thing]:
    """Return the furniture of a room: each piece where there is space, with a way between it and the others.

    Parameters
    ----------
    rng : Generator
        Decides where things stand, and their shapes.
    room : Area
        The room between its walls.
    use : tuple of str
        Pieces, in the order in which they are placed: "desk", "table", "shelf", "cabinet", "plant" or "chairs".
    standing : list of Thing
        What stands already; doors among it are kept clear.
    way : float, optional
        Metres left free around each piece that is no table.
    """
    taken = [footprint([thing]).grown(_DOOR_CLEARANCE) for thing in standing if thing.name == "door"]
    placed = list[Thing]()
    for piece in use:
        for _ in range(_TRIES):
            group = _at_a_wall(rng, _group(rng, piece), room)
            area = footprint(group)
            apart = area.grown(WAY if any(thing.name == "table" for thing in group) else way)
            if room.contains(area) and not any(apart.overlaps(other) for other in taken):
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
        return [make.cabinet(PAINT).at(0, -0.23)]
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
