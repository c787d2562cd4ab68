"""Readers: one file per format, one registry.

`open_scans(path)` gives the scans at a path as a sequence of labelled clouds, each read when it is asked for:

>>> for cloud in open_scans("sequences/08"):  # doctest: +SKIP
...     semantic_map.update(cloud)
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from semgp.cloud import LabelledCloud
from semgp.errors import InputError
from semgp.logs.reader import LogReader
from semgp.readers.e57 import E57Reader, read_e57
from semgp.readers.kitti import read_kitti_bin
from semgp.readers.las import read_las
from semgp.readers.npz import read_npz
from semgp.readers.nyu import NYUFolder, NYUFolderReader, NYUFrame, NYUSource
from semgp.readers.nyu_mat import NYUMat, NYUMatReader
from semgp.readers.pcd import read_pcd
from semgp.readers.ply import read_ply
from semgp.readers.point_folder import PointFolderReader
from semgp.readers.protocol import FileReader, Reader, Scans, options_of
from semgp.readers.rgbd_layouts import RGBD_READERS
from semgp.readers.semantic_kitti import SemanticKITTIReader, SemanticKITTISequence
from semgp.readers.text import TEXT_FILES, read_text
from semgp.readers.trajectory import Trajectory, read_trajectory

POINT_FILES: tuple[FileReader, ...] = (
    FileReader("ply", "a .ply point file", ".ply", read_ply),
    FileReader("pcd", "a .pcd point file", ".pcd", read_pcd),
    FileReader("las", "a .las point file", ".las", read_las),
    FileReader("laz", "a .laz point file, compressed", ".laz", read_las),
    FileReader("npz", "a .npz point file of semgp", ".npz", read_npz),
    FileReader("kitti-bin", "a .bin scan of KITTI", ".bin", read_kitti_bin),
)
"""Formats of one scan a file."""

READERS: tuple[Reader, ...] = (
    *POINT_FILES,
    *TEXT_FILES,
    E57Reader(),
    NYUFolderReader(),
    NYUMatReader(),
    SemanticKITTIReader(),
    *RGBD_READERS,
    LogReader(),
    PointFolderReader((*POINT_FILES, *TEXT_FILES)),  # the last: it takes any folder with a point file
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
    "Trajectory",
    "open_nyu",
    "open_scans",
    "read",
    "read_e57",
    "read_kitti_bin",
    "read_las",
    "read_npz",
    "read_pcd",
    "read_ply",
    "read_text",
    "read_trajectory",
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
        Nothing at the path, nothing of a known format, or options that its reader does not take;
        FileFormatError for damaged files.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file or folder.")
    for reader in READERS:
        if reader.matches(path):
            _require_options(path, reader, options)
            return reader.scans(path, **options)
    known = "\n".join(f"  {reader.layout}" for reader in READERS)
    raise InputError(f"{path} is of no format that semgp reads; it reads\n{known}")


def _require_options(path: Path, reader: Reader, options: Iterable[str]) -> None:
    for option in options:
        if option not in options_of(reader):
            takers = ", ".join(r.name for r in READERS if option in options_of(r)) or "none"
            raise InputError(
                f"{path}: {reader.name} has no option {option!r}; the formats that have it: {takers}."
            )


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
