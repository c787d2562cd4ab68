"""Maps to make pages of."""

from dataclasses import replace

import numpy as np

from semgp.classes import Classes
from semgp.cloud import LabelledCloud
from semgp.maps.free_space import FreeSpace
from semgp.maps.gp import GPSemanticMap
from semgp.maps.presets import GENERAL

MODEL = replace(GENERAL, resolution=0.1)


def built(cloud: LabelledCloud, names: tuple[str, ...] | None = None, shift: float = 0.0) -> GPSemanticMap:
    classes = cloud.classes if names is None else Classes(names)
    T = np.eye(4)
    T[:3, 3] = np.array([1.0, -1.0, 1.2]) + shift
    made = GPSemanticMap(classes, MODEL, free=FreeSpace())
    made.update(LabelledCloud(cloud.points + shift, classes, cloud.labels, T_world_sensor=T))
    return made
