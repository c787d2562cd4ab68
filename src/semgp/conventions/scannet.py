"""ScanNet (Dai et al., 2017): the 20 classes of its benchmark."""

from __future__ import annotations

from dataclasses import replace

from semgp.classes import Classes
from semgp.conventions.nyu import NYU40
from semgp.conventions.tables import split_names

_NYU40_NAMES = split_names("""
    wall, floor, cabinet, bed, chair, sofa, table, door, window, bookshelf, picture, counter, desk, curtain,
    refrigerator, shower curtain, toilet, sink, bathtub, otherfurniture
""")

SCANNET20 = Classes(_NYU40_NAMES, tuple(NYU40.colours[NYU40.index(name)] for name in _NYU40_NAMES))
"""The 20 classes of ScanNet's benchmark, all of them among NYU40, in its colours."""

SCANNET20_FILES = replace(SCANNET20, ids=tuple((NYU40.index(name) + 1,) for name in _NYU40_NAMES))
"""The 20 classes with the NYU40 ids, from 1, that the labels of ScanNet's meshes hold."""
