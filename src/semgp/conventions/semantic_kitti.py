"""SemanticKITTI (Behley et al., 2019): its training classes and their raw ids."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.conventions.tables import coloured_classes, whole_numbers

SEMANTIC_KITTI = coloured_classes("""
    car 6496f5, bicycle 64e6f5, motorcycle 1e3c96, truck 501eb4, other-vehicle 0000ff, person ff1e1e,
    bicyclist ff28c8, motorcyclist 961e5a, road ff00ff, parking ff96ff, sidewalk 4b004b, other-ground af004b,
    building ffc800, fence ff7832, vegetation 00af00, trunk 873c00, terrain 96f050, pole fff096,
    traffic-sign ff0000
""")
"""The 19 training classes of SemanticKITTI (Behley et al., 2019), in its order and colours."""

SEMANTIC_KITTI_IDS: Mapping[str, tuple[int, ...]] = {
    "car": (10, 252),
    "bicycle": (11,),
    "motorcycle": (15,),
    "truck": (18, 258),
    "other-vehicle": (20, 13, 16, 256, 257, 259),
    "person": (30, 254),
    "bicyclist": (31, 253),
    "motorcyclist": (32, 255),
    "road": (40, 60),
    "parking": (44,),
    "sidewalk": (48,),
    "other-ground": (49,),
    "building": (50,),
    "fence": (51,),
    "vegetation": (70,),
    "trunk": (71,),
    "terrain": (72,),
    "pole": (80,),
    "traffic-sign": (81,),
}
"""Raw ids of each training class; those from 252 on are moving things. All other ids are unlabelled."""

SEMANTIC_KITTI_FILES = replace(SEMANTIC_KITTI, ids=tuple(SEMANTIC_KITTI_IDS.values()))
"""The training classes with their raw ids, as `classes` of readers."""


def labels_from_semantic_kitti(ids: ArrayLike) -> NDArray[np.int32]:
    """Return the training labels of raw SemanticKITTI ids; their upper 16 bits, the instance, are ignored.

    Moving things get the class of their kind. Ids that no training class takes in are missing.

    Raises
    ------
    InputError
        Ids that are not whole numbers.
    """
    raw = whole_numbers(ids, 0, (1 << 32) - 1) & 0xFFFF
    return SEMANTIC_KITTI_FILES.from_ids(raw).astype(np.int32)
