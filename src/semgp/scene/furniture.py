"""Pieces of furniture as lists of solids, standing on the floor at the origin with their front towards -y."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, sin

import numpy as np

from semgp.scene.raycast import BOX, CYLINDER, ELLIPSOID

Colour = tuple[int, int, int]
Vector = tuple[float, float, float]

OAK, WALNUT, CARDBOARD = (186, 140, 92), (104, 70, 48), (196, 158, 112)
STEEL, WHITE = (70, 72, 78), (238, 236, 230)
BOOK_COLOURS = (
    *((158, 42, 43), (34, 87, 122), (56, 102, 65), (224, 159, 62), (84, 72, 110)),
    *((222, 214, 196), (51, 53, 51)),
)


@dataclass(frozen=True)
class Solid:
    """One painted solid; see `semgp.scene.raycast.Solids` for its geometry."""

    shape: int
    centre: Vector
    half: Vector
    colour: Colour
    yaw: float = 0.0


@dataclass(frozen=True)
class Thing:
    """One object of a class, made of solids."""

    name: str
    solids: tuple[Solid, ...]

    def at(self, x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> Thing:
        """Return the object turned by `yaw` (radians) and moved to (x, y, z)."""
        c, s = cos(yaw), sin(yaw)
        moved = (
            replace(
                solid,
                centre=(
                    x + c * solid.centre[0] - s * solid.centre[1],
                    y + s * solid.centre[0] + c * solid.centre[1],
                    z + solid.centre[2],
                ),
                yaw=solid.yaw + yaw,
            )
            for solid in self.solids
        )
        return replace(self, solids=tuple(moved))


def block(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], colour: Colour) -> Solid:
    """Return the box between two limits along each axis, in either order."""
    low, high = zip(x, y, z)
    cx, cy, cz = ((a + b) / 2 for a, b in zip(low, high))
    hx, hy, hz = (abs(b - a) / 2 for a, b in zip(low, high))
    return Solid(BOX, (cx, cy, cz), (hx, hy, hz), colour)


def disc(x: float, y: float, z: tuple[float, float], radius: float, colour: Colour) -> Solid:
    """Return the upright cylinder over (x, y) that fills an interval of heights."""
    return Solid(CYLINDER, (x, y, (z[0] + z[1]) / 2), (radius, radius, (z[1] - z[0]) / 2), colour)


def table() -> Thing:
    """Return a dining table, 1.5 m x 0.85 m, 0.74 m high."""
    legs = [disc(x, y, (0, 0.7), 0.035, WALNUT) for x in (-0.66, 0.66) for y in (-0.34, 0.34)]
    return Thing("table", (block((-0.75, 0.75), (-0.425, 0.425), (0.7, 0.74), OAK), *legs))


def chair(colour: Colour) -> Thing:
    """Return a chair with an open back."""
    legs = [disc(x, -0.19, (0, 0.43), 0.02, WALNUT) for x in (-0.19, 0.19)]
    posts = [disc(x, 0.2, (0, 0.88), 0.02, WALNUT) for x in (-0.19, 0.19)]
    seat = block((-0.22, 0.22), (-0.22, 0.22), (0.43, 0.475), colour)
    rails = [block((-0.2, 0.2), (0.185, 0.215), (z, z + 0.12), colour) for z in (0.58, 0.75)]
    return Thing("chair", (seat, *legs, *posts, *rails))


def sofa(colour: Colour, cushion: Colour) -> Thing:
    """Return a sofa for three with two cushions, 2 m wide."""
    darker = (int(colour[0] * 0.85), int(colour[1] * 0.85), int(colour[2] * 0.85))
    arms = [block((x, 0.83 * x), (-0.45, 0.4), (0.08, 0.6), darker) for x in (-1.0, 1.0)]
    seats = [block((x, x + 0.54), (-0.45, 0.2), (0.3, 0.45), colour) for x in (-0.82, -0.27, 0.28)]
    backs = [block((x, x + 0.54), (0.1, 0.26), (0.45, 0.8), colour) for x in (-0.82, -0.27, 0.28)]
    cushions = [Solid(ELLIPSOID, (x, 0.02, 0.6), (0.2, 0.09, 0.17), cushion) for x in (-0.62, 0.58)]
    frame = [
        block((-0.86, 0.86), (-0.43, 0.4), (0.08, 0.3), darker),
        block((-0.86, 0.86), (0.25, 0.4), (0.08, 0.76), darker),
    ]
    return Thing("sofa", (*frame, *arms, *seats, *backs, *cushions))


def cabinet(colour: Colour) -> Thing:
    """Return a sideboard with four doors, 1.6 m wide, 0.82 m high."""
    doors = [block((x, x + 0.37), (-0.235, -0.2), (0.12, 0.76), colour) for x in (-0.775, -0.385, 0.015, 0.405)]
    knobs = [Solid(ELLIPSOID, (x, -0.25, 0.48), (0.016, 0.016, 0.016), STEEL) for x in (-0.44, -0.35, 0.35, 0.44)]
    body = block((-0.8, 0.8), (-0.22, 0.22), (0.08, 0.8), WALNUT)
    return Thing("cabinet", (body, block((-0.82, 0.82), (-0.25, 0.22), (0.79, 0.82), OAK), *doors, *knobs))


def bookshelf(rng: np.random.Generator) -> Thing:
    """Return a shelf full of books of random sizes and colours, 1.2 m wide, 1.9 m high."""
    boards = [block((-0.6, 0.6), (-0.16, 0.16), (z, z + 0.025), OAK) for z in (0.06, 0.44, 0.82, 1.2, 1.58, 1.88)]
    sides = [block((x, x + 0.025), (-0.16, 0.16), (0, 1.9), OAK) for x in (-0.61, 0.585)]
    back = block((-0.6, 0.6), (0.145, 0.16), (0, 1.9), WALNUT)
    books = []
    for z in (0.085, 0.465, 0.845, 1.225, 1.605):
        x = -0.58
        while x < 0.4:
            width, height = rng.uniform(0.04, 0.12), rng.uniform(0.19, 0.27)
            if rng.random() < 0.88:
                front = -rng.uniform(0.08, 0.13)
                books.append(block((x, x + width), (front, 0.14), (z, z + height), pick(rng, BOOK_COLOURS)))
            x += width + 0.002
    return Thing("bookshelf", (*boards, *sides, back, *books))


def floor_lamp(colour: Colour) -> Thing:
    """Return a standing lamp, 1.65 m high."""
    shade = disc(0, 0, (1.32, 1.65), 0.2, colour)
    return Thing("lamp", (disc(0, 0, (0, 0.03), 0.15, STEEL), disc(0, 0, (0.03, 1.35), 0.018, STEEL), shade))


def table_lamp(colour: Colour) -> Thing:
    """Return a lamp for a sideboard, 0.5 m high."""
    foot = Solid(ELLIPSOID, (0, 0, 0.13), (0.085, 0.085, 0.13), WHITE)
    return Thing("lamp", (foot, disc(0, 0, (0.25, 0.29), 0.012, STEEL), disc(0, 0, (0.28, 0.5), 0.15, colour)))


def window() -> Thing:
    """Return a window of six panes in a white frame, 1.9 m x 1.2 m, its sill at the origin."""
    bars = [block((x - 0.03, x + 0.03), (-0.05, 0), (0, 1.2), WHITE) for x in (-0.92, -0.31, 0.31, 0.92)]
    rails = [block((-0.95, 0.95), (-0.05, 0), (z - 0.03, z + 0.03), WHITE) for z in (0.03, 0.6, 1.17)]
    panes = [
        block((-0.92, 0.92), (-0.015, 0), z, sky)
        for z, sky in (((0, 0.6), (176, 208, 226)), ((0.6, 1.2), (146, 192, 228)))
    ]
    return Thing("window", (*bars, *rails, *panes, block((-1.0, 1.0), (-0.14, 0), (-0.04, 0), WHITE)))


def picture(width: float, height: float, rng: np.random.Generator) -> Thing:
    """Return a framed abstract landscape, its lower edge at the origin."""
    x, z = width / 2, height
    frame = block((-x, x), (-0.03, 0), (0, z), (46, 42, 40))
    canvas = block((0.04 - x, x - 0.04), (-0.034, 0), (0.04, z - 0.04), (236, 220, 190))
    heights = np.sort(rng.uniform(0.12, 0.62, 3))[::-1] * (z - 0.08)  # the nearest hill is the lowest
    hills = [
        block((0.04 - x, x - 0.04), (-0.036 - 0.002 * i, 0), (0.04, 0.04 + top), pick(rng, BOOK_COLOURS[:5]))
        for i, top in enumerate(heights)
    ]
    middle = (rng.uniform(-0.25, 0.25) * width, -0.03, 0.76 * z)
    sun = Solid(ELLIPSOID, middle, (0.09 * z, 0.008, 0.09 * z), (226, 112, 72))
    return Thing("picture", (frame, canvas, *hills, sun))


def box(size: Vector) -> Thing:
    """Return a cardboard box with a strip of tape."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    tape = block((-0.03, 0.03), (-y - 0.002, y + 0.002), (0.6 * z, z + 0.002), (222, 200, 160))
    return Thing("box", (block((-x, x), (-y, y), (0, z), CARDBOARD), tape))


def ball(radius: float, colour: Colour) -> Thing:
    """Return a ball that lies on the floor."""
    return Thing("ball", (Solid(ELLIPSOID, (0, 0, radius), (radius, radius, radius), colour),))


def pick(rng: np.random.Generator, colours: tuple[Colour, ...]) -> Colour:
    """Return one of some colours."""
    return colours[rng.integers(len(colours))]
