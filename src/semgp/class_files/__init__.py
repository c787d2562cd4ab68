"""Class files: names, colours and raw ids of a user's classes, and what each takes in from another list.

Three formats hold the same. TOML, one table a class in the order of the labels:

    [[class]]
    name = "seat"
    colour = "#9500f0"            # optional
    ids = [5, 6]                  # optional: raw ids in files that mean it; left out, the label itself
    from = ["armchair", "sofa"]   # optional: names of another list that become this class

A csv with the columns name and, if wanted, colour, ids and from, the last two with `;` between their items. And
the yaml of SemanticKITTI, with labels, learning_map, learning_map_inv and color_map.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from semgp.class_files.csv_format import read_csv, write_csv
from semgp.class_files.rows import ClassFile
from semgp.class_files.semantic_kitti_yaml import read_semantic_kitti_yaml
from semgp.class_files.toml_format import read_toml, write_toml
from semgp.classes import Classes
from semgp.conventions import ADE20K_32, ADE20K_32_TO_NYU13, CLASS_LISTS, NYU13, NYU40, NYU40_TO_NYU13
from semgp.errors import InputError

__all__ = ["REMAPPINGS", "ClassFile", "class_list", "read_class_file", "remapping", "write_class_file"]

READERS = {
    ".toml": read_toml,
    ".csv": read_csv,
    ".yaml": read_semantic_kitti_yaml,
    ".yml": read_semantic_kitti_yaml,
}
WRITERS = {".toml": write_toml, ".csv": write_csv}


def read_class_file(path: str | Path) -> ClassFile:
    """Read a class file; its ending tells the format.

    Raises
    ------
    InputError
        Another ending; FileFormatError for a file that is missing, damaged, or makes no sense.
    """
    path = Path(path)
    if path.suffix.lower() not in READERS:
        raise InputError(f"{path}: a class file ends in {', '.join(READERS)}.")
    return READERS[path.suffix.lower()](path)


def write_class_file(path: str | Path, classes: Classes | ClassFile) -> None:
    """Write a class file, whole or not at all; its ending, .toml or .csv, tells the format.

    Plain `classes` are written without raw ids: what semgp writes are the labels themselves.

    Raises
    ------
    InputError
        Another ending.
    """
    path = Path(path)
    if path.suffix.lower() not in WRITERS:
        raise InputError(f"{path}: class files are written as {' or '.join(WRITERS)}.")
    content = classes if isinstance(classes, ClassFile) else ClassFile(Classes(classes.names, classes.colours))
    WRITERS[path.suffix.lower()](path, content)


REMAPPINGS: Mapping[str, ClassFile] = {
    "ade20k-32-to-nyu13": ClassFile.from_table(ADE20K_32, NYU13, ADE20K_32_TO_NYU13),
    "nyu40-to-nyu13": ClassFile.from_table(NYU40, NYU13, NYU40_TO_NYU13),
}
"""The remappings that users name."""


def remapping(name: str | Path) -> ClassFile:
    """Return a remapping: a built-in one by name, or that of a class file by path.

    Raises
    ------
    InputError
        Nothing of that name; FileFormatError for a class file that is damaged.
    """
    if str(name).lower() in REMAPPINGS:
        return REMAPPINGS[str(name).lower()]
    if not Path(name).suffix:
        raise InputError(f"no remapping is called {name!s}: give a class file, or one of {', '.join(REMAPPINGS)}.")
    return read_class_file(name)


def class_list(name: str) -> Classes:
    """Return a class list: a built-in one by name, that of a file by path, or so many numbered classes.

    Raises
    ------
    InputError
        Nothing of that name; FileFormatError for a class file that is damaged.
    """
    if name.lower() in CLASS_LISTS:
        return CLASS_LISTS[name.lower()]
    if name.isascii() and name.isdecimal() and 1 <= int(name) <= 1000:
        return Classes.numbered(int(name))
    if Path(name).suffix.lower() in READERS:
        return read_class_file(name).classes
    raise InputError(
        f"there is no class list {name!r}: give one of {', '.join(CLASS_LISTS)}, a number of classes up to 1000, "
        f"or a file that ends in {', '.join(READERS)}."
    )
