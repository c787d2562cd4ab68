"""Rectangles of a floor plan, and those that things fill."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from semgp.scene.furniture import Thing


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


def footprint(things: list[Thing]) -> Area:
    """Return the rectangle that some things fill, seen from above."""
    solids = [solid for thing in things for solid in thing.solids]
    middle, half = (np.array([getattr(solid, name)[:2] for solid in solids]) for name in ("centre", "half"))
    yaw = np.array([solid.yaw for solid in solids])
    c, s = np.abs(np.cos(yaw)), np.abs(np.sin(yaw))
    reach = np.stack([c * half[:, 0] + s * half[:, 1], s * half[:, 0] + c * half[:, 1]], axis=1)
    (left, bottom), (right, top) = (middle - reach).min(axis=0), (middle + reach).max(axis=0)
    return Area((float(left), float(right)), (float(bottom), float(top)))
