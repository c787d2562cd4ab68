"""Readers: one file per format, one registry.

`open_scans(path)` gives the scans at a path as a sequence of labelled clouds, each read when it is asked for:

>>> for cloud in open_scans("sequences/08"):  # doctest: +SKIP
...     semantic_map.update(cloud)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.readers.npz import read_npz
from semgp.readers.nyu import NYUFolder, NYUFolderReader, NYUFrame, NYUSource
from semgp.readers.nyu_mat import NYUMat, NYUMatReader
from semgp.readers.pcd import read_pcd
from semgp.readers.ply import read_ply
from semgp.readers.protocol import FileReader, Reader, Scans
from semgp.readers.semantic_kitti import SemanticKITTIReader, SemanticKITTISequence

READERS: tuple[Reader, ...] = (
    FileReader("ply", "a .ply point file", ".ply", read_ply),
    FileReader("pcd", "a .pcd point file", ".pcd", read_pcd),
    FileReader("npz", "a .npz point file of semgp", ".npz", read_npz),
    NYUFolderReader(),
    NYUMatReader(),
    SemanticKITTIReader(),
)
"""All formats; `open_scans` takes the first that matches."""

__all__ = [
    "READERS",
    "FileReader",
    "NYUFolder",
    "NYUFrame",
    "NYUMat",
    "NYUSource",
    "Reader",
    "Scans",
    "SemanticKITTISequence",
    "open_nyu",
    "open_scans",
    "read",
    "read_npz",
    "read_pcd",
    "read_ply",
]


def open_scans(path: str | Path, **options: Any) -> Sequence[LabelledCloud]:
    """Return the scans at a path, each read when it is asked for.

    Parameters
    ----------
    path : str or Path
        A point file, or a folder of a known layout; the format is told from its name and contents.
    **options
        Options of the format, such as `classes` for point files or `labels="predictions"` for data sets:
        see the format's reader.

    Raises
    ------
    InputError
        Nothing at the path, or nothing of a known format; FileFormatError for damaged files.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder.")
    for reader in READERS:
        if reader.matches(path):
            return reader.scans(path, **options)
    known = "\n".join(f"  {reader.layout}" for reader in READERS)
    raise InputError(f"{path} is of no format that semgp reads; it reads\n{known}")


def read(path: str | Path, **options: Any) -> LabelledCloud:
    """Read the one cloud at a path; options as in `open_scans`.

    Raises
    ------
    InputError
        As `open_scans`, or more than one scan at the path.
    """
    scans = open_scans(path, **options)
    if len(scans) != 1:
        raise InputError(f"{path} holds {len(scans)} scans: open_scans gives them one by one.")
    return scans[0]


def open_nyu(path: str | Path) -> NYUSource:
    """Return the frames of NYU Depth V2 at a path: a folder of images, or the official .mat file.

    Raises
    ------
    FileFormatError
        Neither of the two.
    """
    return NYUMat(path) if Path(path).is_file() else NYUFolder(path)
