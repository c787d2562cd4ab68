"""NYU Depth V2 (Silberman et al., 2012): its lists of 13 and of 40 classes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semgp.classes import Classes
from semgp.conventions.tables import coloured_classes, table_between, whole_numbers

NYU13 = coloured_classes("""
    bed 0000ff, books e95930, ceiling 00da00, chair 9500f0, floor def118, furniture ffcece, objects 00e0e5,
    picture 6a88cc, sofa 751d29, table f023eb, tv 00a79c, wall f98b00, window e1e5c2
""")
"""The 13 classes of Couprie et al. (2013) for NYU Depth V2, in the colours of SceneNet RGB-D."""

NYU40 = coloured_classes("""
    wall aec7e8, floor 98df8a, cabinet 1f77b4, bed ffbb78, chair bcbd22, sofa 8c564b, table ff9896,
    door d62728, window c5b0d5, bookshelf 9467bd, picture c49c94, counter 17becf, blinds b24c4c, desk f7b6d2,
    shelves 42bc66, curtain dbdb8d, dresser 8c39c5, pillow cab934, mirror 33b0cb, floor mat c83683,
    clothes 5cc13d, ceiling 4e47b7, books ac7252, refrigerator ff7f0e, television 5ba38a, paper 99629c,
    towel 8c9965, shower curtain 9edae5, box 647d9a, whiteboard b27f87, person 78b980, night stand 926fc2,
    toilet 2ca02c, sink 708090, lamp 60cfd1, bathtub e377c2, bag d55cb0, otherstructure 5e6ad3,
    otherfurniture 5254a3, otherprop 645590
""")
"""The 40 classes of Gupta et al. (2013) for NYU Depth V2, in the colours of ScanNet."""

NYU40_TO_NYU13 = table_between(
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

NYU13_FILES = replace(NYU13, ids=tuple((c + 1,) for c in range(13)))
"""The 13 classes with the ids, from 1, that label images of the data set hold."""

NYU40_FILES = replace(NYU40, ids=tuple((c + 1,) for c in range(40)))
"""The 40 classes with the ids, from 1, that label images of the data set hold."""


def labels_from_nyu(ids: ArrayLike, classes: Classes) -> NDArray[np.int32]:
    """Return the labels of an NYU label image, whose ids are 0 = unlabelled and 1 to K = class.

    Raises
    ------
    InputError
        Ids above the number of classes.
    """
    return whole_numbers(ids, 0, len(classes)).astype(np.int32) - np.int32(1)
