"""Label folders: what a network or a person says about images, as `semgp segment` writes it.

`classes.toml` is a class file (see `semgp.class_files`): the classes of the labels. For an image with the file
stem S there are

* `S.png`, of the image's size: labels 0 to C - 1 in 8 bits, 255 where missing; with more than 255 classes 16 bits
  and 65535. Where the class file has ids, these are what the pixels hold, and all others are missing.
* `S.npz`, if wanted: `p`, (h, w, C) uint8, 255 times the class probabilities on a grid over the image, which may
be
  coarser; and `corners`, true where the grid follows that custom (see `semgp.readers.grids`).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgp.class_files import read_class_file, write_class_file
from semgp.classes import MISSING, Classes
from semgp.cloud import LabelledCloud
from semgp.errors import FileFormatError, InputError
from semgp.readers.grids import Grid, sample
from semgp.readers.images import read_label_image
from semgp.readers.npz import read_arrays
from semgp.writers import atomic_write

CLASS_FILE = "classes.toml"


class LabelFolder:
    """A folder of label images.

    Parameters
    ----------
    path : str or Path
        The folder.
    classes : Classes, optional
        What the labels mean, instead of the folder's `classes.toml`.

    Raises
    ------
    InputError
        No such folder; FileFormatError for one without classes, or with a class file that is damaged.
    """

    def __init__(self, path: str | Path, classes: Classes | None = None) -> None:
        self.path = Path(path)
        if not self.path.is_dir():
            raise InputError(f"{path}: no such folder of labels; 'semgp segment' writes one.")
        if classes is None and not (self.path / CLASS_FILE).is_file():
            raise FileFormatError(self.path, f"has no {CLASS_FILE}, which says what its labels mean.")
        self.classes = classes or read_class_file(self.path / CLASS_FILE).classes

    def labels(self, stem: str, shape: tuple[int, int] | None = None) -> NDArray[np.int32]:
        """Return the labels (H, W) of an image, `MISSING` where there is none.

        Raises
        ------
        FileFormatError
            A file that is missing, damaged, of another shape than the image, or with labels of no class.
        """
        path = self.path / f"{stem}.png"
        ids = read_label_image(path, shape, wide=True)
        labels = self.classes.from_ids(ids)
        if not self.classes.ids:
            labels[ids == (255 if ids.dtype == np.uint8 else 65535)] = MISSING
        if labels.max(initial=MISSING) >= len(self.classes):
            raise FileFormatError(
                path, f"has labels up to {labels.max()}, but there are {len(self.classes)} classes."
            )
        return labels.astype(np.int32)

    def probability(self, stem: str) -> tuple[NDArray[np.float32], bool] | None:
        """Return the class probabilities (h, w, C) of an image, and whether by corners; None where it has none.

        Raises
        ------
        FileFormatError
            A file that is damaged or of another layout.
        """
        path = self.path / f"{stem}.npz"
        if not path.is_file():
            return None
        arrays = read_arrays(path, ("p", "corners"))
        p, corners = arrays.get("p"), arrays.get("corners", np.False_)
        if p is None or p.dtype != np.uint8 or p.ndim != 3 or p.shape[2] != len(self.classes) or not p.size:
            raise FileFormatError(path, f"must hold p, a (h, w, {len(self.classes)}) array of uint8.")
        if corners.shape != () or corners.dtype != np.bool_:
            raise FileFormatError(path, "has corners that are neither true nor false.")
        return p.astype(np.float32) / np.float32(255), bool(corners)

    def labelled(self, cloud: LabelledCloud, stem: str, *, soft: bool = True) -> LabelledCloud:
        """Return a cloud with the labels of its pixels in an image.

        Parameters
        ----------
        cloud : LabelledCloud
            With `pixels` and `image_shape`; its own labels are replaced.
        stem : str
            Name of the image's file without its last ending.
        soft : bool
            Prefer soft labels.

        Raises
        ------
        FileFormatError
            Files that are missing, damaged or of another shape than the image.
        """
        if cloud.pixels is None or cloud.image_shape is None:
            raise InputError("the cloud does not say from which pixels its points are.")
        labels, weights = self.at_pixels(stem, cloud.pixels, cloud.image_shape, soft=soft)
        return replace(cloud, classes=self.classes, labels=labels, weights=weights)

    def at_pixels(
        self, stem: str, pixels: NDArray[np.int32], shape: tuple[int, int], *, soft: bool = True
    ) -> tuple[NDArray[np.int32] | None, NDArray[np.float32] | None]:
        """Return the hard labels (N,) or the soft ones (N, C) at pixels of an image; the other is None.

        Parameters
        ----------
        stem : str
            Name of the image's file without its last ending.
        pixels : (N, 2) array
            Rows and columns.
        shape : (int, int)
            Rows and columns of the image.
        soft : bool
            Prefer soft labels.
        """
        found = self.probability(stem) if soft else None
        if found is None:
            return self.labels(stem, shape)[pixels[:, 0], pixels[:, 1]], None
        return None, sample(found[0], pixels, shape, corners=found[1])


def open_for_writing(path: str | Path, classes: Classes) -> None:
    """Make a label folder for some classes, or check that the one that is there is of these.

    Raises
    ------
    InputError
        A file, or a folder with labels of other classes, is in the way.
    """
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise InputError(f"{path} is a file; give the name of a folder.")
    path.mkdir(parents=True, exist_ok=True)
    file = path / CLASS_FILE
    if not file.exists():
        write_class_file(file, Classes(classes.names, classes.colours))
    elif read_class_file(file).classes != classes:
        raise InputError(f"{path} holds labels of other classes: give another folder, or remove it first.")


def write_labels(
    path: str | Path,
    stem: str,
    labels: NDArray[np.integer[Any]],
    n_classes: int,
    probability: Grid | None = None,
    *,
    corners: bool = False,
) -> None:
    """Write what is known about one image, each file whole or not at all, the label image last.

    Parameters
    ----------
    path : str or Path
        The folder.
    stem : str
        Name of the image's file without its last ending.
    labels : (H, W) integer array
        Labels, `MISSING` where there is none.
    n_classes : int
        Number of classes, which decides between 8 and 16 bits.
    probability : (h, w, C) array, optional
        Class probabilities; a row may sum to less than one.
    corners : bool
        The custom of their grid.

    Raises
    ------
    InputError
        Probabilities out of range.
    """
    from PIL import Image

    if probability is not None:
        p = np.round(255 * probability)
        if not ((p >= 0) & (p <= 255)).all():
            raise InputError("class probabilities must lie between 0 and 1.")
        p = p.astype(np.uint8)
        with atomic_write(Path(path) / f"{stem}.npz") as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, p=p, corners=np.bool_(corners))
    top, kind = (255, np.uint8) if n_classes <= 255 else (65535, np.uint16)
    image = Image.fromarray(np.where(labels == MISSING, top, labels).astype(kind))
    with atomic_write(Path(path) / f"{stem}.png") as temporary:
        image.save(temporary, format="PNG")
