"""A scan of a floor and a wall."""

import numpy as np

from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud

ROOM = Classes(("floor", "wall"))


def scan_of_a_corner() -> LabelledCloud:
    """A floor at z = 0.01 and a wall at x = 2.01, seen from above the floor; every second label is missing."""
    a, b = np.meshgrid(np.arange(0.2, 2, 0.02), np.arange(-0.8, 0.8, 0.02), indexing="ij")
    floor = np.stack([a, b, np.full_like(a, 0.01)], axis=-1).reshape(-1, 3)
    height = 1.0 + b[0] * 1.2
    y, z = np.meshgrid(b[0], height, indexing="ij")
    upright = np.stack([np.full_like(y, 2.01), y, z], axis=-1).reshape(-1, 3)
    labels = np.repeat([0, 1], [len(floor), len(upright)])
    labels[::2] = MISSING
    T_world_sensor = np.eye(4)
    T_world_sensor[:3, 3] = 0.3, 0.0, 1.2
    return LabelledCloud(np.concatenate([floor, upright]), ROOM, labels, T_world_sensor=T_world_sensor)
