"""A furnished living room: which objects stand where, from one seed."""

from __future__ import annotations

from itertools import pairwise
from math import pi

import numpy as np

from semgp.classes import Classes
from semgp.scene import furniture as make
from semgp.scene.furniture import Colour, Thing, block, disc, pick

LENGTH, WIDTH, HEIGHT = 5.6, 4.6, 2.6
"""Inner size of the room in metres along x, y and z; the origin lies on the floor, in the middle."""

CLASSES = Classes(
    names=(
        *("floor", "wall", "ceiling", "window", "picture", "table", "chair"),
        *("sofa", "cabinet", "bookshelf", "lamp", "box", "ball"),
    ),
    colours=(
        *((222, 184, 135), (150, 174, 208), (226, 206, 226), (76, 201, 214), (236, 96, 158), (240, 134, 40)),
        *((206, 52, 58), (52, 104, 192), (138, 74, 170), (46, 146, 92), (250, 206, 46), (126, 86, 56)),
        (160, 208, 60),
    ),
)
"""The thirteen classes of the room."""

_CHAIRS = ((52, 86, 102), (178, 84, 58), (92, 116, 82))
_SOFAS = ((92, 118, 138), (120, 128, 110), (146, 112, 96))
_CUSHIONS = ((226, 168, 72), (196, 90, 74), (222, 206, 176))
_SHADES = ((244, 228, 192), (236, 214, 170))
_BALLS = ((206, 62, 50), (240, 182, 42), (58, 128, 168))


def furnish(seed: int) -> list[Thing]:
    """Return the objects of the room; another seed gives other places, colours, books and pictures."""
    rng = np.random.default_rng(seed)
    return [*_shell(rng), *_at_the_walls(rng), *_around_the_table(rng), *_on_the_floor(rng)]


def _shell(rng: np.random.Generator) -> list[Thing]:
    """Return floor, walls and ceiling."""
    x, y, z, thick = LENGTH / 2, WIDTH / 2, HEIGHT, 0.2
    edges = np.linspace(-y, y, 12)
    planks = [block((-x, x), (a, b), (-thick, 0), _oak(rng)) for a, b in pairwise(edges)]
    walls = []
    for side in (-1, 1):
        walls += [
            block((-x, x), (side * y, side * (y + thick)), (0, z), (226, 220, 208)),
            block((side * x, side * (x + thick)), (-y, y), (0, z), (214, 206, 190)),
            block((-x, x), (side * y, side * (y - 0.015)), (0, 0.08), (244, 242, 236)),
            block((side * x, side * (x - 0.015)), (-y, y), (0, 0.08), (244, 242, 236)),
        ]
    rug = [
        disc(0.1, -0.1, (0, 0.008 + 0.001 * i), r, c)
        for i, (r, c) in enumerate(((1.5, (164, 88, 74)), (1.38, (222, 206, 180))))
    ]
    ceiling = block((-x, x), (-y, y), (z, z + thick), (246, 245, 242))
    return [Thing("floor", (*planks, *rug)), Thing("wall", tuple(walls)), Thing("ceiling", (ceiling,))]


def _at_the_walls(rng: np.random.Generator) -> list[Thing]:
    """Return what stands at the walls or hangs on them, each moved sideways by up to 12 cm."""
    x, y = LENGTH / 2, WIDTH / 2
    aside = rng.uniform(-0.12, 0.12, 8)
    shade = pick(rng, _SHADES)
    return [
        make.window().at(-0.2 + aside[0], y, 0.95),
        make.sofa(pick(rng, _SOFAS), pick(rng, _CUSHIONS)).at(-0.2 + aside[1], y - 0.45),
        make.floor_lamp(shade).at(-1.75 + aside[2], y - 0.35),
        make.bookshelf(rng).at(x - 0.18, 1.15 + aside[3], yaw=-pi / 2),
        make.cabinet((214, 196, 168)).at(x - 0.25, -0.9 + aside[4], yaw=-pi / 2),
        make.table_lamp(shade).at(x - 0.25, -1.35 + aside[4], 0.82),
        make.picture(1.0, 0.7, rng).at(x, -0.75 + aside[4], 1.35, yaw=-pi / 2),
        make.picture(0.7, 0.9, rng).at(-x, 0.75 + aside[5], 1.15, yaw=pi / 2),
        make.picture(0.9, 0.65, rng).at(-x, -0.45 + aside[5], 1.3, yaw=pi / 2),
        make.cabinet((120, 134, 128)).at(-0.7 + aside[6], 0.25 - y, yaw=pi),
        make.picture(1.3, 0.8, rng).at(-0.7 + aside[6], -y, 1.25, yaw=pi),
        make.box((0.34, 0.26, 0.2)).at(-1.15 + aside[6], 0.25 - y, 0.82, yaw=pi + aside[7]),
    ]


def _around_the_table(rng: np.random.Generator) -> list[Thing]:
    """Return the table, four chairs pushed about a little, and a box on the table."""
    x, y = 0.1 + rng.uniform(-0.1, 0.1), -0.15 + rng.uniform(-0.1, 0.1)
    places = ((-0.4, -0.62, pi), (0.38, -0.66, pi), (-0.38, 0.62, 0.0), (0.95, 0.05, -pi / 2))
    colour = pick(rng, _CHAIRS)
    chairs = [
        make.chair(colour).at(
            x + dx + rng.normal(0, 0.03), y + dy + rng.normal(0, 0.03), yaw=yaw + rng.normal(0, 0.2)
        )
        for dx, dy, yaw in places
    ]
    parcel = make.box((0.3, 0.22, 0.14)).at(x + 0.35, y + 0.05, 0.74, yaw=rng.uniform(-0.6, 0.6))
    return [make.table().at(x, y), *chairs, parcel]


def _on_the_floor(rng: np.random.Generator) -> list[Thing]:
    """Return a pile of boxes in the corner and two balls."""
    corner = (0.42 - LENGTH / 2, 0.5 - WIDTH / 2)
    turn = rng.uniform(-0.25, 0.25, 3)
    first, second = (_BALLS[i] for i in rng.permutation(len(_BALLS))[:2])
    return [
        make.box((0.6, 0.5, 0.45)).at(*corner, yaw=turn[0]),
        make.box((0.42, 0.36, 0.32)).at(*corner, 0.45, yaw=turn[1]),
        make.box((0.5, 0.4, 0.36)).at(corner[0] + 0.05, corner[1] + 0.68, yaw=turn[2]),
        make.ball(0.22, first).at(-1.75 + rng.uniform(-0.1, 0.1), 0.85 + rng.uniform(-0.1, 0.1)),
        make.ball(0.15, second).at(1.75 + rng.uniform(-0.1, 0.1), 0.75 + rng.uniform(-0.1, 0.1)),
    ]


def _oak(rng: np.random.Generator) -> Colour:
    red, green, blue = (int(v) for v in np.array((196, 158, 116)) * rng.uniform(0.88, 1.06))
    return red, green, blue
