"""The colour images that a path means: a file, a folder, a pattern, or the frames of a data set."""

from __future__ import annotations

from glob import glob, has_magic
from pathlib import Path

from semgp.errors import InputError
from semgp.readers.nyu import NYUFolder, NYUFolderReader
from semgp.readers.rgbd import RGBDSequence
from semgp.readers.rgbd_layouts import RGBD_READERS, images_in


def images_of(path: str | Path) -> tuple[Path, ...]:
    """Return the colour images at a path, in order.

    For an RGB-D recording these are those of the frames that have a pose, in the order of its scans; for a folder
    of NYU frames, their colour images, likewise.

    Parameters
    ----------
    path : str or Path
        An image, a folder of images or of a known RGB-D layout, or a pattern such as `"drive/*.jpg"`.

    Raises
    ------
    InputError
        Nothing there; FileFormatError for a folder without images.
    """
    path = Path(path)
    if path.is_file():
        return (path,)
    if not path.is_dir():
        found = tuple(Path(name) for name in sorted(glob(str(path)))) if has_magic(str(path)) else ()
        if not found:
            raise InputError(f"{path}: no such file or folder, and no pattern that any file fits.")
        return found
    for layout in RGBD_READERS:
        if layout.matches(path):
            return tuple(frame.colour for frame in RGBDSequence(path, layout.recording(path)).frames)
    if NYUFolderReader().matches(path):
        return tuple(path / f"{number:04d}_rgb.jpg" for number in NYUFolder(path).frames)
    return tuple(images_in(path))
