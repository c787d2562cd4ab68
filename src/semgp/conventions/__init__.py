"""The class lists of the public data sets, and the tables between them: one data set a file.

Labels here are semgp's: 0 to K - 1, and `MISSING` (-1) where there is none. A table is an integer array that
`relabel` indexes with labels of one list to give those of another.
"""

from __future__ import annotations

from collections.abc import Mapping

from semgp.classes import Classes
from semgp.conventions.ade20k import ADE20K, ADE20K_32, ADE20K_32_TO_NYU13
from semgp.conventions.nyu import NYU13, NYU13_FILES, NYU40, NYU40_FILES, NYU40_TO_NYU13, labels_from_nyu
from semgp.conventions.scannet import SCANNET20, SCANNET20_FILES
from semgp.conventions.semantic_kitti import (
    SEMANTIC_KITTI,
    SEMANTIC_KITTI_FILES,
    SEMANTIC_KITTI_IDS,
    labels_from_semantic_kitti,
)
from semgp.conventions.tables import relabel

CLASS_LISTS: Mapping[str, Classes] = {
    "nyu13": NYU13_FILES,
    "nyu40": NYU40_FILES,
    "scannet": SCANNET20_FILES,
    "semantickitti": SEMANTIC_KITTI_FILES,
    "ade20k": ADE20K,
    "ade20k-32": ADE20K_32,
}
"""The lists that users name, each with the raw ids that the files of its data set hold."""

__all__ = [
    "ADE20K",
    "ADE20K_32",
    "ADE20K_32_TO_NYU13",
    "CLASS_LISTS",
    "NYU13",
    "NYU13_FILES",
    "NYU40",
    "NYU40_FILES",
    "NYU40_TO_NYU13",
    "SCANNET20",
    "SCANNET20_FILES",
    "SEMANTIC_KITTI",
    "SEMANTIC_KITTI_FILES",
    "SEMANTIC_KITTI_IDS",
    "labels_from_nyu",
    "labels_from_semantic_kitti",
    "relabel",
]
