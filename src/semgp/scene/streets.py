"""Blocks of an endless town: what stands on each and along its kerbs, from the seed and its place alone."""

from __future__ import annotations

from math import pi

import numpy as np

from semgp.classes import Classes
from semgp.conventions import SEMANTIC_KITTI
from semgp.scene.furniture import Solid, Thing, block, disc, pick
from semgp.scene.raycast import ELLIPSOID

BLOCK = 80.0
"""Length of a block in metres along x and y; streets run along the multiples of it, a block lies between."""

ROAD, BAY, WALK = 3.5, 5.7, 8.2
"""Where carriageway, parking bay and sidewalk end, in metres from the middle of the street."""

_NAMES = (
    *("road", "parking", "sidewalk", "terrain", "building", "fence"),
    *("vegetation", "trunk", "pole", "traffic-sign", "car"),
)

TOWN_CLASSES = Classes(_NAMES, tuple(SEMANTIC_KITTI.colours[SEMANTIC_KITTI.index(name)] for name in _NAMES))
"""Eleven classes of SemanticKITTI, in its colours."""

_MISTAKEN_FOR = {
    "road": ("parking", "sidewalk", "terrain"),
    "parking": ("road", "sidewalk", "terrain"),
    "sidewalk": ("road", "parking", "terrain"),
    "terrain": ("vegetation", "sidewalk", "parking"),
    "building": ("fence", "vegetation", "pole"),
    "fence": ("building", "vegetation", "terrain"),
    "vegetation": ("building", "fence", "trunk"),
    "trunk": ("vegetation", "pole", "fence"),
    "pole": ("trunk", "traffic-sign", "fence"),
    "traffic-sign": ("pole", "building", "vegetation"),
    "car": ("vegetation", "building", "fence"),
}

MISTAKEN_FOR = np.array(
    [[_NAMES.index(other) for other in _MISTAKEN_FOR[name]] for name in _NAMES], dtype=np.int32
)
"""Labels (11, 3) of the classes that networks are apt to take each class for."""

_KERB, _LOT = BLOCK / 2 - ROAD, BLOCK / 2 - WALK
"""Half the length of a block without its streets, and without its sidewalks."""

_GREY, _GREEN, _BROWN = (128, 128, 128), (70, 120, 60), (110, 80, 50)
_PLASTER = ((222, 206, 176), (190, 120, 96), (204, 204, 200))


def town_block(seed: int, column: int, row: int) -> list[Thing]:
    """Return what a block holds, world frame: the same at every call, whichever blocks were made before.

    Parameters
    ----------
    seed : int
        The town, not negative.
    column, row : int
        Place of the block, of any sign: it covers x from `column * BLOCK` on, and y from `row * BLOCK` on.
    """
    rng = np.random.default_rng((seed, column % 2**32, row % 2**32))  # seeds take no negative numbers
    content = (_homes, _homes, _homes, _shop, _park)[rng.integers(5)](rng)
    walk, ground = BLOCK / 2 - BAY, _LOT
    things = [
        Thing("sidewalk", (block((-walk, walk), (-walk, walk), (-1, 0.12), _GREY),)),
        Thing("terrain", (block((-ground, ground), (-ground, ground), (-1, 0.15), _GREEN),)),
        *content,
    ]
    for side in range(4):
        things += [thing.at(0, 0, yaw=side * pi / 2) for thing in _kerb(rng)]
    return [thing.at((column + 0.5) * BLOCK, (row + 0.5) * BLOCK) for thing in things]


def _kerb(rng: np.random.Generator) -> list[Thing]:
    """Return parking bay, parked cars, lamps, street trees and a sign along the southern edge of a block."""
    bay, kerb = -BLOCK / 2 + (ROAD + BAY) / 2, -BLOCK / 2 + BAY + 0.5
    things = [Thing("parking", (block((-27, 27), (-_KERB, BAY - BLOCK / 2), (-1, 0.03), _GREY),))]
    things += [_car(rng).at(x + rng.uniform(-0.4, 0.4), bay) for x in np.linspace(-23, 23, 9)[rng.random(9) < 0.3]]
    things += [Thing("pole", (disc(x, kerb, (0, 6.5), 0.09, _GREY),)) for x in (-28.5, 28.5)]
    for x in np.array([-20, -10, 0, 10, 20])[rng.random(5) < 0.7]:
        things += _tree(rng, x + rng.uniform(-2, 2), kerb + 0.4)
    return things + _sign(-31.0, kerb)


def _homes(rng: np.random.Generator) -> list[Thing]:
    """Return two rows of four houses, back to back, each with a garden."""
    return [thing.at(0, 0, yaw=turn) for turn in (0.0, pi) for x in (-24, -8, 8, 24) for thing in _home(rng, x)]


def _home(rng: np.random.Generator, x: float) -> list[Thing]:
    """Return a house on a lot 16 m wide, its drive, fences, a hedge or bushes, and trees."""
    front = -_LOT + rng.uniform(3, 6)
    width, back, eaves = rng.uniform(8.5, 10.5), front + rng.uniform(8, 11), rng.uniform(4, 8)
    left = x - 7.4
    house = (
        block((left, left + width), (front, back), (0, eaves), pick(rng, _PLASTER)),
        block((left + 1, left + width - 1), (front + 1.5, back - 1.5), (eaves, eaves + 2), _BROWN),
    )
    drive = block((left + width + 0.3, x + 7.6), (-_LOT, front + 6), (-1, 0.17), _GREY)
    things = [Thing("building", house), Thing("parking", (drive,)), _fence((x + 7.7, x + 7.8), (-_LOT, -0.5))]
    if rng.random() < 0.5:
        things.append(_car(rng).at((left + width + x + 7.7) / 2, front + 2.5, yaw=pi / 2))
    if rng.random() < 0.5:
        things.append(_fence((left - 0.4, left + width), (-_LOT + 0.2, -_LOT + 0.3)))
    else:
        hedge = block((left - 0.4, left + width), (-_LOT + 0.2, -_LOT + 1), (0, rng.uniform(1, 2)), _GREEN)
        things.append(Thing("vegetation", (hedge,)))
    things += [_bush(rng, left + rng.uniform(0.5, width - 0.5), front - 1) for _ in range(rng.integers(3))]
    for y in (-3.5, -8.0):
        things += _tree(rng, x + rng.uniform(-5, 5), y) if rng.random() < 0.5 else []
    return things


def _shop(rng: np.random.Generator) -> list[Thing]:
    """Return a hall, and a car park with two rows of cars in front of it."""
    hall = block((-26, 26), (6, 27), (0, rng.uniform(6, 10)), pick(rng, _PLASTER))
    things = [
        Thing("building", (hall,)),
        Thing("parking", (block((-28, 28), (-_LOT, 4), (-1, 0.17), _GREY),)),
    ]
    for y in (-22.0, -6.0):
        taken = np.linspace(-25, 25, 19)[rng.random(19) < 0.5]
        things += [_car(rng).at(x, y, yaw=pi / 2) for x in taken]
        things += [Thing("pole", (disc(x, y - 3.5, (0, 7), 0.1, _GREY),)) for x in (-14.0, 14.0)]
    return things


def _park(rng: np.random.Generator) -> list[Thing]:
    """Return a lawn with trees and bushes, a path across, and a fence along two of its edges."""
    things = [Thing("sidewalk", (block((-_LOT, _LOT), (-1.5, 1.5), (-1, 0.17), _GREY),))]
    things += [_fence((x, x + 0.1), (4, _LOT - 0.5)) for x in (-_LOT + 0.3, _LOT - 0.4)]
    for x in (-26, -16, -6, 6, 16, 26):
        for y in (-25, -15, -6, 6, 15, 25):
            place = x + rng.uniform(-3, 3), y + rng.uniform(-2, 2)
            kind = rng.random()
            things += _tree(rng, *place) if kind < 0.4 else [_bush(rng, *place)] if kind < 0.8 else []
    return things


def _car(rng: np.random.Generator) -> Thing:
    """Return a parked car along x, 3.9 to 4.7 m long."""
    x, colour = rng.uniform(1.95, 2.35), pick(rng, ((40, 44, 52), (196, 198, 200), (150, 34, 38), (38, 70, 120)))
    body = block((-x, x), (-0.88, 0.88), (0.25, 0.9), colour)
    return Thing("car", (body, block((-0.75 * x, 0.45 * x), (-0.78, 0.78), (0.9, rng.uniform(1.4, 1.65)), colour)))


def _tree(rng: np.random.Generator, x: float, y: float) -> list[Thing]:
    """Return a trunk and its crown."""
    fork, radius, height = rng.uniform(1.8, 2.6), rng.uniform(1.2, 2.2), rng.uniform(1.5, 2.8)
    crown = Solid(ELLIPSOID, (x, y, fork + 0.85 * height), (radius, radius, height), _GREEN)
    trunk = disc(x, y, (0, fork + 0.5), rng.uniform(0.12, 0.28), _BROWN)
    return [Thing("trunk", (trunk,)), Thing("vegetation", (crown,))]


def _bush(rng: np.random.Generator, x: float, y: float) -> Thing:
    half = rng.uniform(0.5, 1.1, 3)
    return Thing("vegetation", (Solid(ELLIPSOID, (x, y, 0.4), (half[0], half[1], half[2]), _GREEN),))


def _fence(x: tuple[float, float], y: tuple[float, float]) -> Thing:
    return Thing("fence", (block(x, y, (0, 1.3), _BROWN),))


def _sign(x: float, y: float) -> list[Thing]:
    """Return a sign across the street and its pole."""
    plate = block((x - 0.06, x - 0.04), (y - 0.35, y + 0.35), (2.1, 2.8), (200, 30, 30))
    return [Thing("pole", (disc(x, y, (0, 2.9), 0.04, _GREY),)), Thing("traffic-sign", (plate,))]
