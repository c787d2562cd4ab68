"""The class lists of the public data sets, and the tables between them.

Labels here are semgp's: 0 to K - 1, and `MISSING` (-1) where there is none. A table is an integer array that
`relabel` indexes with labels of one list to give those of another.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import MISSING, Classes
from semgp.errors import InputError


def _split(text: str) -> tuple[str, ...]:
    """Return the comma-separated items of a text."""
    return tuple(" ".join(item.split()) for item in text.split(","))


def _coloured(text: str) -> Classes:
    """Return the classes of a text of names, each followed by its colour rrggbb."""
    rows = [item.rsplit(" ", 1) for item in _split(text)]
    colours = tuple((v >> 16, v >> 8 & 255, v & 255) for v in (int(colour, 16) for _, colour in rows))
    return Classes(tuple(name for name, _ in rows), colours)


def _table(source: Classes, target: Classes, members: Mapping[str, str]) -> NDArray[np.int32]:
    """Return the target label of each source label, given the source names that each target name takes in."""
    table = np.full(len(source), MISSING, dtype=np.int32)
    for name, source_names in members.items():
        table[[source.index(s) for s in _split(source_names)]] = target.index(name)
    table.setflags(write=False)
    return table


NYU13 = _coloured("""
    bed 0000ff, books e95930, ceiling 00da00, chair 9500f0, floor def118, furniture ffcece, objects 00e0e5,
    picture 6a88cc, sofa 751d29, table f023eb, tv 00a79c, wall f98b00, window e1e5c2
""")
"""The 13 classes of Couprie et al. (2013) for NYU Depth V2, in the colours of SceneNet RGB-D."""

NYU40 = _coloured("""
    wall aec7e8, floor 98df8a, cabinet 1f77b4, bed ffbb78, chair bcbd22, sofa 8c564b, table ff9896,
    door d62728, window c5b0d5, bookshelf 9467bd, picture c49c94, counter 17becf, blinds b24c4c, desk f7b6d2,
    shelves 42bc66, curtain dbdb8d, dresser 8c39c5, pillow cab934, mirror 33b0cb, floor mat c83683,
    clothes 5cc13d, ceiling 4e47b7, books ac7252, refrigerator ff7f0e, television 5ba38a, paper 99629c,
    towel 8c9965, shower curtain 9edae5, box 647d9a, whiteboard b27f87, person 78b980, night stand 926fc2,
    toilet 2ca02c, sink 708090, lamp 60cfd1, bathtub e377c2, bag d55cb0, otherstructure 5e6ad3,
    otherfurniture 5254a3, otherprop 645590
""")
"""The 40 classes of Gupta et al. (2013) for NYU Depth V2, in the colours of ScanNet."""

ADE20K_32 = Classes(
    _split("""
        other, wall, building, sky, floor, tree, ceiling, road, bed, windowpane, grass, cabinet, sidewalk,
        person, earth, door, table, mountain, plant, curtain, chair, car, water, painting, sofa, shelf, house,
        sea, mirror, rug, field, armchair
    """)
)
"""The 31 most frequent classes of ADE20K and "other": what the MOSAIC network tells apart."""

SEMANTIC_KITTI = _coloured("""
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

NYU40_TO_NYU13 = _table(
    NYU40,
    NYU13,
    {
        "bed": "bed",
        "books": "books",
        "ceiling": "ceiling",
        "chair": "chair",
        "floor": "floor, floor mat",
        "furniture": """cabinet, bookshelf, counter, shelves, dresser, refrigerator, night stand,
                        otherfurniture""",
        "objects": """pillow, mirror, clothes, paper, towel, shower curtain, box, whiteboard, person, toilet,
                      sink, lamp, bathtub, bag, otherstructure, otherprop""",
        "picture": "picture",
        "sofa": "sofa",
        "table": "table, desk",
        "tv": "television",
        "wall": "wall, door",
        "window": "window, blinds, curtain",
    },
)
"""NYU13 label of each NYU40 label, shape (40,): the map that goes with Couprie et al. (2013)."""

ADE20K_32_TO_NYU13 = _table(
    ADE20K_32,
    NYU13,
    {
        "bed": "bed",
        "ceiling": "ceiling",
        "chair": "chair, armchair",
        "floor": "floor, rug, road, sidewalk, earth",
        "furniture": "cabinet, shelf",
        "objects": "person, plant, mirror",
        "picture": "painting",
        "sofa": "sofa",
        "table": "table",
        "wall": "wall, door, building, house",
        "window": "windowpane, curtain",
    },
)
"""NYU13 label of each ADE20K-32 label, shape (32,); missing where there is no counterpart."""


def relabel(labels: ArrayLike, table: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return labels of one list as labels of another; missing ones stay missing.

    Parameters
    ----------
    labels : integer array of any shape
        Labels from -1 to K - 1.
    table : (K,) array
        New label of each old one, such as `NYU40_TO_NYU13`.

    Raises
    ------
    InputError
        Labels outside the table.
    """
    old = _whole(labels, MISSING, len(table) - 1)
    return np.asarray(np.append(table, MISSING)[old], dtype=np.int32)  # -1 picks the last entry


def labels_from_nyu(ids: ArrayLike, classes: Classes) -> NDArray[np.int32]:
    """Return the labels of an NYU label image, whose ids are 0 = unlabelled and 1 to K = class.

    Raises
    ------
    InputError
        Ids above the number of classes.
    """
    return _whole(ids, 0, len(classes)).astype(np.int32) - np.int32(1)


def labels_from_semantic_kitti(ids: ArrayLike) -> NDArray[np.int32]:
    """Return the training labels of raw SemanticKITTI ids; their upper 16 bits, the instance, are ignored.

    Moving things get the class of their kind. Ids that no training class takes in are missing.

    Raises
    ------
    InputError
        Ids that are not whole numbers.
    """
    lookup = np.full(1 << 16, MISSING, dtype=np.int32)
    for name, raw_ids in SEMANTIC_KITTI_IDS.items():
        lookup[list(raw_ids)] = SEMANTIC_KITTI.index(name)
    return np.asarray(lookup[_whole(ids, 0, (1 << 32) - 1) & 0xFFFF])


def _whole(values: ArrayLike, low: int, high: int) -> NDArray[np.integer]:
    """Check that values are whole numbers from low to high."""
    a = np.asarray(values)
    if a.dtype.kind not in "iu":
        raise InputError(f"labels must be whole numbers, not {a.dtype}.")
    if a.size and (a.min() < low or a.max() > high):
        raise InputError(f"labels go from {a.min()} to {a.max()}, but must lie between {low} and {high}.")
    return a
